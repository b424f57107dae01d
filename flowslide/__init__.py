"""The face of the tool: what notebooks, web pages and the command line call.

In: case folders and settings. Out: scenes, runs, answers, verdicts and reports.
"""
