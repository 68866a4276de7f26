"""Each mechanism of `slam/` and `explore/` turned off in real plans: what is lost without it."""
