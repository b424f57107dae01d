"""Estimation: misfit, derivatives, searches and the uncertainty of what they find.

In: a problem and an engine. Out: estimates.
"""
