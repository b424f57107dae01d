"""The material point method itself: arrays, splines, transfer, boundary, and the two schedules.

In: scenes ready for the device. Out: moved points. Taichi is imported here.
"""
