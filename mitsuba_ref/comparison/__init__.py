"""Pictures compared: what is measured, and the limits that judge it."""
