"""Framework of the effects: their base class, registry, hooks into the kernels and options.

In: the files of effects. Out: what the solver and the command line use of them.
"""
