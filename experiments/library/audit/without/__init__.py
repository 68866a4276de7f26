"""What a run, a graph or measured relations tell of their own covariances, without any truth."""
