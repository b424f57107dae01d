"""The inverse problem: the question, its unknowns, its data, and what a forward engine must do.

In: the YAML files of a case. Out: what engines and estimation work on.
"""
