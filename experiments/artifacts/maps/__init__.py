"""The map of a run as files, written and read again."""
