"""Charts that a page draws with plotly: zoom, hover, no network."""
