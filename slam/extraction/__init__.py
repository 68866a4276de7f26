"""From a scan to straight segments."""
