"""From walls and paths to motion commands."""
