"""Measurements of a slide: one definition for the field survey and for simulated points.

In: measurement files; material points of a deposit. Out: measured numbers and their counterparts.
"""
