"""Scenes: the document, its checks, its filling with material points, and sections drawn elsewhere.

In: YAML, JSON, CSV, GeoJSON or DXF. Out: `scene.Scene` and material points.
"""
