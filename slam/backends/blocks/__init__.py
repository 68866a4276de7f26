"""Filters with the paper's memory: the diagonal blocks of the covariance, and no other."""
