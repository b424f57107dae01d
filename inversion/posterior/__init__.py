"""The whole posterior of a case: an emulator of its runs, sampled by a nested sampler.

In: an `InversionCase`. Out: draws of everything unknown, what they predict, and the evidence.
"""
