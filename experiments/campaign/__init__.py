"""Campaigns: many trials, their tables and the comparison of estimators and strategies."""
