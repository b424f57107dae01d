"""Predictions: from strengths known with a standard deviation to the distribution of the runout.

In: a case and strengths. Out: `prediction.json`.
"""
