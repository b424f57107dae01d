"""The texts of a new case folder.

In: a section and a survey. Out: YAML with comments.
"""
