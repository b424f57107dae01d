"""Rollouts of a learned simulator, and their derivatives.

In: a simulator and a first window. Out: positions by frame, and what they depend on.
"""
