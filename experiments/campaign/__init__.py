"""Campaigns: many trials, three questions, one table."""
