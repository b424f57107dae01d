"""The fit of a model with effects: unknowns, response surface, covariance, forward runs.

In: a model and measurements. Out: fits.
"""
