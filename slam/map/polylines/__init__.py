"""Bends: where a wall is a polyline, and what all scans together know of it."""
