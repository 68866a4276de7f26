"""Words, tables and pictures as one page."""
