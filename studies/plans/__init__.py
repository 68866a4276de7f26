"""Whether dimensions of plans, and what is said of walls that were built elsewhere, are as true as stated."""
