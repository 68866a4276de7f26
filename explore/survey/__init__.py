"""What is not known yet, and from where to look at it."""
