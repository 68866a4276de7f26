"""How far and how well robots explore."""
