"""Scores of a run without ground truth."""
