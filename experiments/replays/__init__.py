"""Recorded scans through a back end, with the truth in place of one part where that is asked for."""
