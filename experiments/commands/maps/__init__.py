"""Commands that read a saved map."""
