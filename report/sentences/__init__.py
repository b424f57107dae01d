"""Sentences of the reports.

In: the data of a report. Out: sentences; an empty one where there is nothing to say.
"""
