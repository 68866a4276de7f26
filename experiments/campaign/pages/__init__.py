"""A campaign as pages, pictures and a recording."""
