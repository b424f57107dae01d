"""The report of a diagnosis.

In: a verdict. Out: `report.html`, and tables in text.
"""
