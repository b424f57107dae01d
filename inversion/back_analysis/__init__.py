"""The back-analysis of a case, from its folder to `result.json`.

In: a case folder. Out: a `result.Result` and its files.
"""
