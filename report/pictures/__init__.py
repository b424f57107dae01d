"""Pictures and films of sections, runs and cases.

In: scenes and runs. Out: PNG, SVG, GIF, MP4.
"""
