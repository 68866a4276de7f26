"""Pictures for papers and reports."""
