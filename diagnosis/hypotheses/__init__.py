"""What may be missing: candidate effects, survey errors, and the model that has some of them.

In: a case. Out: candidates and a model that can be run with any of them.
"""
