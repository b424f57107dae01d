"""Constitutive laws, one file each.

In: trial strains. Out: stresses.
"""
