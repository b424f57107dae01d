"""The whole posterior of a back-analysis: emulator, nested sampling, what moves the answer.

The answer of `inversion.back_analysis` is a point and a covariance. Here the unknowns and
everything else that is uncertain vary together, as far as their priors reach: a few hundred coarse
simulations make an emulator, fine ones correct it, and a nested sampler explores it.
"""
