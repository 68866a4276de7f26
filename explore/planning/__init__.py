"""Ways over the floor and along walls."""
