"""Scores: where truth and estimate meet. Every number of summary.json is computed here."""
