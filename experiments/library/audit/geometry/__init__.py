"""Errors of poses and their covariances: in the plane, and in space."""
