"""Forward engines: the material point method, the learned simulator, and what they keep of runs.

In: values of the unknowns. Out: predicted measurements.
"""
