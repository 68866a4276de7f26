"""Logs of recorded robots."""
