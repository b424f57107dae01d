"""What the reports say.

In: the data of a report. Out: sentences; an empty one where there is nothing to say.
"""
