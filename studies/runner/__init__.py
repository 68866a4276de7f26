"""Many runs, a row for each, written as it comes: begun again, they go on where they were interrupted."""
