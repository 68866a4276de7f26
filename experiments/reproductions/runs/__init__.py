"""What several of the paper's figures share: worlds driven once, and what was measured on the way."""
