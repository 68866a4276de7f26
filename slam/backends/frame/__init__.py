"""Where a map that begins in the blind lies in the world."""
