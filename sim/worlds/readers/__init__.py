"""Readers of drawn maps, one file for each format."""
