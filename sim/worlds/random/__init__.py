"""Randomly generated buildings, always the same for one seed."""
