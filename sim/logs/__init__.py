"""Recorded robots."""
