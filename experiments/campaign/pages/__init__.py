"""A campaign as report, pictures and recording."""
