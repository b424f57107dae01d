"""Learning: loss, noise, optimisers, checkpoints, one process or several.

In: packed data. Out: weights.
"""
