"""Sections from a few stated numbers: the file of a slide that nobody drew, what it leaves open.

In: `dimensions.yaml`. Out: a family of sections, each from a score of every dimension.
"""
