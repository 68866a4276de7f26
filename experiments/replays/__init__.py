"""Recorded scans through a back end, optionally with the truth in place of one part of the software."""
