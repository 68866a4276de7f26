"""What is kept of one trial of a campaign."""
