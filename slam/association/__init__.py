"""Which wall of the map each segment of a scan belongs to."""
