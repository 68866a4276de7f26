"""What a run tells without anybody knowing the truth."""
