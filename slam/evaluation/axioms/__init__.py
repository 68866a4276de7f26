"""What every back end owes, whoever wrote it: each axiom a function that says what it found instead."""
