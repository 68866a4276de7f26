"""Buildings by chance, always the same for one seed."""
