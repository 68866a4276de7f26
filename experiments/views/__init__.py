"""Pictures, pages and timelines of what runs left."""
