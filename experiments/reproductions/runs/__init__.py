"""Shared parts of the reproductions: drives of the paper's worlds and their measurements."""
