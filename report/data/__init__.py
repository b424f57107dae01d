"""Data of the reports: a document with the files around it, read once.

In: the folder of a back-analysis or a diagnosis. Out: what charts, tables, sentences use.
"""
