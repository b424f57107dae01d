"""Commands about generated scenes and trajectory files."""
