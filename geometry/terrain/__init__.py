"""Elevations on a regular grid: files, and the lighting of maps."""
