"""What was seen free and what was hit, at estimated poses."""
