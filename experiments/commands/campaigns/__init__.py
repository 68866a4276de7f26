"""Commands that run many trials."""
