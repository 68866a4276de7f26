"""Studies of the product by its own parts; the product never imports them."""
