"""What the Kalman filters share."""
