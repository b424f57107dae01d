"""What is read from a three-dimensional deposit."""
