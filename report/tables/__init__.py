"""The tables of the reports, for a page and for a terminal alike.

In: the data of a report. Out: `report.table.Table`s; without rows where there is nothing to show.
"""
