"""The graph network: units, graph, features, layers, and the simulator that steps with it.

In: positions and scene facts. Out: the next positions.
"""
