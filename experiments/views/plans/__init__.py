"""A dimensioned plan of a saved map, and its comparison with a drawing."""
