"""What several studies measure with: renderers, references, scenes that are generated."""
