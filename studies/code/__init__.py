"""Counts and a picture of the source code itself."""
