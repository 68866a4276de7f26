"""Logs of real robots."""
