"""Data of the learned simulator: packed trajectories, their windows, splits, ranges and facts.

In: trajectory files. Out: shards and windows.
"""
