"""A map against the drawing of its building."""
