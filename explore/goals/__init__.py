"""Which open end or place next, and what was given up and why."""
