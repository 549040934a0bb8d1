"""Light sources, and sampling directions towards them."""
