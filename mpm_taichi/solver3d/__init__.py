"""The material point method in three dimensions.

Same law, transfer and guards as `solver`, written for three axes; nothing of it is compiled into
the two-dimensional kernels.
"""
