"""From a scan to a stochastic map of line segments; knows nothing of simulation, goals or drawing."""
