"""Ways to match the segments of a scan to the walls of a map; `methods` has their names."""
