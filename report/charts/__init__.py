"""Charts of results, one question a file.

In: numbers of a document. Out: matplotlib figures.
"""
