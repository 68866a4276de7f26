"""The layers of a timeline, one file for each."""
