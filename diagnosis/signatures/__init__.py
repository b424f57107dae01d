"""What each candidate would change, what the misfit resembles, and what looks alike.

In: a fit and candidates. Out: scores.
"""
