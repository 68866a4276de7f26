"""What is wrong with a scanner's ranges, told from walls and wheels."""
