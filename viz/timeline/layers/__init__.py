"""What a timeline draws, one file for each part of the picture."""
