"""Where the rooms meet, and the only place that joins truth and estimate: trials, scores, the command line."""
