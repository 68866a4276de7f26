"""Tables and comparison of a campaign's trials."""
