"""Charts of results, one kind a file.

In: numbers of a document. Out: matplotlib figures.
"""
