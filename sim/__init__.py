"""Simulation and recordings: drawn worlds, a range finder, slipping wheels, recorded runs."""
