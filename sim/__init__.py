"""Robots without hardware: drawn worlds, a range finder, slipping wheels, recorded runs."""
