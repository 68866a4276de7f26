"""How good a map is beside the true walls: what of them it covers, and its corners."""
