"""Studies of other robots: bodies, scanners, faults, and worlds of other simulators."""
