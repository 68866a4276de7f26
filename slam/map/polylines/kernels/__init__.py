"""What scans say of bends and steps, in compiled loops."""
