"""Is a model adequate, and where does it fail?

In: a fit. Out: tests and windows.
"""
