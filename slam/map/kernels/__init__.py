"""What is known of the walls of a map, in compiled loops."""
