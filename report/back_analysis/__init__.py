"""The report of a back-analysis.

In: the folder of a back-analysis. Out: `report.html`, and the summary in text.
"""
