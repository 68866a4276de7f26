"""Every file that a run leaves, written and read again."""
