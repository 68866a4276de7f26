"""Which rules of `slam/` and `explore/` earn their place: each is switched off, and what gets worse is counted."""
