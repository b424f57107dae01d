"""Which candidates are added, kept or dropped; the decision, and what to measure next.

In: scores. Out: accepted models and a decision.
"""
