"""What all scans of a drive say together, once it has ended."""
