"""Pictures, pages and timelines of results."""
