"""Quality of a map compared with the true walls: coverage, corners, distances and free-space coverage."""
