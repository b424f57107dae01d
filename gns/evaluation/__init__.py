"""How good a model is: metrics, baselines, tables and the card.

In: rollouts and the runs they stand for. Out: scores and `card.yaml`.
"""
