"""Pure functions of the plane, vectorised over their first axes."""
