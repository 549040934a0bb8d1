"""From XML text to the plain tree."""
