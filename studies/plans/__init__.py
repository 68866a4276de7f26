"""Are the dimensions of plans, and what is said of walls that were built elsewhere, as true as they are stated?"""
