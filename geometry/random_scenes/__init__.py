"""Scenes drawn at random from the templates (a) to (e) of the paper (Fig. 3, Table A.1).

In: a configuration and a number. Out: `scene.Scene`.
"""
