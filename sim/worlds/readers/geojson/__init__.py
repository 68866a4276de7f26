"""GeoJSON: what its features are, where they lie in metres, and on which storey."""
