"""The stochastic map, what is known of each of its walls, and the chains that they form."""
