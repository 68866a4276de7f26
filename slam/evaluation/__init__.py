"""How wrong an estimate is, and whether it knows: pure functions of errors and covariances."""
