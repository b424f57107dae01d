"""The verdict as a document, and the files around it.

In: what the diagnosis found. Out: `verdict.json`.
"""
