"""The scene document in three dimensions, and its filling with points."""
