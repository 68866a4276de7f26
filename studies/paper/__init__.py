"""The paper's figures over many seeds: their numbers, and the page that shows them."""
