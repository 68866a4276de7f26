"""Where truth and estimate meet: every number of summary.json."""
