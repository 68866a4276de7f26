"""The page of results: its tables, made from stored rows."""
