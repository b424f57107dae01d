"""Is a planted relation found again? Catalogues of slides whose relation is known.

    python -m benchmarks.studies.joint_calibration [--catalogues 1000]

Relations (median, scatter, slope) are drawn from the prior of `flowslide joint`, each with a
catalogue of eight slides: blow counts between 3 and 16, ln ratios known to 0.1 to 0.4. Each dam
stands if its ratio as seen exceeds what its shape asks for (0.15 to 0.6), and is then known as a
bound. Where all is right, the rank of the truth in its posterior is uniform (simulation-based
calibration, Talts et al. 2018). A second part asks how often a slope is told. Minutes on one core;
the figures are kept in `joint_calibration.json` and stand in `docs/method/joint.md`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.generated_pages import ROOT, renew, table
from inversion.joint.evidence import BlowCountOfSlide, SlideEvidence
from inversion.joint.infer import slope
from inversion.joint.population import SLOPE_STD, TAU_STD, PriorGrid, at_shares
from inversion.posterior.calibration import band, coverage
from pipeline.files import read_json, write_json

RECORD = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs" / "method" / "joint.md"
CATALOGUES, SLIDES, SEED = 1000, 8, 45
COUNTS, COUNT_STD = (3.0, 16.0), 2.0
LOG_STDS, LEAST_RATIOS = (0.1, 0.4), (0.15, 0.6)
NOMINAL = (0.5, 0.8, 0.95)
UNKNOWNS = ("median", "scatter", "slope")
#: Slides, and slopes per blow, of the second part; its scatter and median are those of published
#: ranges.
SIZES, SLOPES = (4, 8, 15, 30), (0.0, 0.05, 0.1)
TYPICAL = (np.log(0.095), 0.36)
ASKED_CATALOGUES = 60


def catalogue(
    random: np.random.Generator, mu: float, tau: float, rise: float, number: int
) -> list[SlideEvidence]:
    """Slides of a relation: Gaussians, and bounds of those that stood.

    The relation's median is that at the mean of the blow counts as they were read. A true count is
    the one that was read with the error of a boring.
    """
    counts = random.uniform(*COUNTS, number)
    true = counts + COUNT_STD * random.standard_normal(number)
    logs = mu + rise * (true - counts.mean()) + tau * random.standard_normal(number)
    stds = random.uniform(*LOG_STDS, number)
    seen = logs + stds * random.standard_normal(number)
    limits = np.log(random.uniform(*LEAST_RATIOS, number))
    return [
        SlideEvidence(
            case=f"slide_{place}",
            title=f"slide {place}",
            kind="bound" if seen[place] > limits[place] else "slide",
            centres=np.array([min(seen[place], limits[place])]),
            weights=np.ones(1),
            std=float(stds[place]),
            formal_std=float(stds[place]),
            source="",
            zones=(),
            sigma_v0_kpa=100.0,
            blow_count=BlowCountOfSlide(float(counts[place]), COUNT_STD, recalled=False),
        )
        for place in range(number)
    ]


def ranks_of(number: int) -> list[float]:
    """Ranks of median, scatter and slope of one catalogue in its posterior."""
    random = np.random.default_rng([SEED, number])
    truth = at_shares(random.random(3))
    values = [float(truth.mu), float(truth.tau), float(truth.slope or 0.0)]
    found = PriorGrid(slope=True).posterior(catalogue(random, *values, SLIDES))
    return [round(found.share_below(axis, value), 6) for axis, value in enumerate(values)]


def told(number: int, size: int, rise: float) -> bool:
    """Whether a slope is told in a catalogue of typical slides."""
    random = np.random.default_rng([SEED, size, number])
    slides = [one for one in catalogue(random, *TYPICAL, rise, size)]
    return slope(slides).told


def collect(catalogues: int) -> dict:
    """All figures."""
    ranks = []
    for number in range(catalogues):
        ranks.append(ranks_of(number))
        if number % 20 == 0:
            print("catalogue", number, flush=True)
    shares = {}
    for size in SIZES:
        for rise in SLOPES:
            hits = sum(told(number, size, rise) for number in range(ASKED_CATALOGUES))
            shares[f"{size} {rise:g}"] = hits / ASKED_CATALOGUES
            print(size, rise, hits, flush=True)
    return {"ranks": ranks, "told": shares, "tau_std": TAU_STD, "slope_std": SLOPE_STD}


def coverage_table(record: dict) -> str:
    """Share of the truths within central intervals, as Markdown."""
    ranks = np.array(record["ranks"])
    header = [f"{len(ranks)} catalogues of {SLIDES}", *(f"{100 * one:.0f} %" for one in NOMINAL)]
    bands = [[end / len(ranks) for end in band(len(ranks), one)] for one in NOMINAL]
    rows = [["*calibrated: within*", *(f"*{100 * a:.0f} to {100 * b:.0f} %*" for a, b in bands)]]
    for place, name in enumerate(UNKNOWNS):
        found = coverage(ranks[:, place], NOMINAL)
        cells = [f"{100 * one.covered:.0f} %{'' if one.inside else ' (outside)'}" for one in found]
        rows.append([name, *cells])
    every = [one for place in range(3) for one in coverage(ranks[:, place], NOMINAL)]
    inside = f"{sum(one.inside for one in every)} of {len(every)} shares lie within their band."
    return f"{table(header, rows)}\n\n{inside}"


def told_table(record: dict) -> str:
    """Share of catalogues in which a slope is told, as Markdown."""
    header = ["slope per blow", *(f"{size} slides" for size in SIZES)]
    rows = [[f"{rise:g}", *(_share(record, size, rise) for size in SIZES)] for rise in SLOPES]
    return table(header, rows)


def _share(record: dict, size: int, rise: float) -> str:
    return f"{100 * record['told'][f'{size} {rise:g}']:.0f} %"


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, renew the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--catalogues", type=int, default=CATALOGUES)
    parser.add_argument("--page", action="store_true", help="run nothing, renew the page")
    chosen = parser.parse_args(argv)
    if not chosen.page:
        write_json(RECORD, collect(chosen.catalogues))
    record = read_json(RECORD)
    renew(PAGE, ranks=coverage_table(record), told=told_table(record))


if __name__ == "__main__":
    main()
