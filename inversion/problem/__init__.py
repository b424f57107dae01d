"""The inverse problem: the question, and how it changes the section that is simulated.

In: the YAML files of a case. Out: what engines and estimation work on.
"""
