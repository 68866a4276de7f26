"""From a scan to straight segments, in compiled loops."""
