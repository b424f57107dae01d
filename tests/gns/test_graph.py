"""Edges: both searches give what a comparison of all pairs gives, in the same order."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from gns.network.graph import (
    RADIUS_SLACK,
    Graph,
    graph_by_cells,
    graph_by_tree,
    joined,
    radius_graph,
)
from tests.budget import examples

SEARCHES = [graph_by_tree, graph_by_cells]


def by_all_pairs(positions: torch.Tensor, radius: float) -> torch.Tensor:
    """(E, 2) receivers and senders, sorted."""
    places = positions.double()
    apart = (places[:, None] - places[None]).square().sum(-1)
    near = apart <= (radius * (1 + RADIUS_SLACK)) ** 2
    return (near & ~torch.eye(len(places), dtype=torch.bool)).nonzero()


def check(graph: Graph, positions: torch.Tensor, radius: float) -> None:
    edges = by_all_pairs(positions, radius)
    assert torch.equal(graph.receivers, edges[:, 0])
    assert torch.equal(graph.senders, edges[:, 1])
    counts = torch.bincount(graph.receivers, minlength=len(positions))
    assert torch.equal(graph.starts.diff(), counts) and graph.starts[0] == 0
    assert graph.points == len(positions) and graph.edges == len(edges)


@settings(deadline=None, max_examples=examples(60))
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(0, 70),
    size=st.sampled_from([0.0, 1.0, 8.0, 60.0]),
    far=st.booleans(),
    dtype=st.sampled_from([torch.float32, torch.float64]),
)
def test_both_searches_equal_all_pairs(seed, count, size, far, dtype):
    rng = np.random.default_rng(seed)
    places = rng.uniform(-0.5 * size, 0.5 * size, (count, 2))
    if far and count:
        places[0] = [3e5, -2e4]  # one point thrown far out: a grid over all must stay small
    positions = torch.tensor(places, dtype=dtype)
    for search in SEARCHES:
        check(search(positions, 3.0), positions, 3.0)


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("shift", [0.0, 137.31])
def test_points_of_a_lattice_have_28_neighbours_wherever_it_lies(search, shift):
    column, row = torch.meshgrid(torch.arange(9.0), torch.arange(9.0), indexing="ij")
    positions = torch.stack([column, row], -1).reshape(-1, 2) + shift
    graph = search(positions, 3.0)
    middle = 4 * 9 + 4
    assert graph.starts[middle + 1] - graph.starts[middle] == 28


@pytest.mark.parametrize("search", SEARCHES)
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_position_that_is_not_finite_is_refused(search, value):
    positions = torch.tensor([[0.0, 0.0], [value, 1.0]])
    with pytest.raises(ValueError, match="not finite"):
        search(positions, 3.0)


def test_joined_graphs_keep_to_themselves():
    generator = torch.Generator().manual_seed(1)
    parts = [torch.rand(count, 2, generator=generator) * 6 for count in (20, 0, 1, 15)]
    graphs = [radius_graph(part, 2.0) for part in parts]
    # The same points so far apart that no edge is added between the parts.
    together = torch.cat([part + 100 * number for number, part in enumerate(parts)])
    check(joined(graphs), together, 2.0)
    assert joined(graphs[:1]) is graphs[0]


@pytest.mark.cuda
@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
def test_the_search_on_a_gpu_equals_the_tree():
    generator = torch.Generator().manual_seed(1)
    positions = torch.rand(3000, 2, generator=generator) * 55
    own, other = radius_graph(positions.cuda(), 3.0), graph_by_tree(positions, 3.0)
    for name in ("senders", "receivers", "starts"):
        assert torch.equal(getattr(own, name).cpu(), getattr(other, name))
