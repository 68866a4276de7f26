"""Pictures and recordings of runs; it reads everything and changes nothing."""
