"""The catalogue of published flow slides and correlations of residual strength.

In: `catalogue.csv`. Out: tables to compare answers with.
"""
