"""Commands of the learned simulator."""
