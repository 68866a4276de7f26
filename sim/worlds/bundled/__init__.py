"""The drawings of the named worlds."""
