"""Studies behind choices of the numerics."""
