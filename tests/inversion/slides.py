"""Slides made by hand, as `flowslide joint` reads them from results."""

from __future__ import annotations

import math

import numpy as np

from inversion.joint.evidence import BlowCountOfSlide, SlideEvidence

#: Shipped cases.
NAMES = ["lower_san_fernando", "la_marquesa", "upper_san_fernando"]
#: Settings of a quick sampler.
FEW = ["posterior.live_points=60", "posterior.draws=400"]


def slide(case: str, ratio: float, std: float, kind="slide", **more) -> SlideEvidence:
    return SlideEvidence(
        case, case.replace("_", " ").title(), kind, np.array([math.log(ratio)]), np.ones(1),
        std, std, "result.json", ("1",), 100.0, **more,
    )  # fmt: skip


def dams() -> list[SlideEvidence]:
    """Like the shipped ones: two that ran, and one that stood."""
    counts = [BlowCountOfSlide(12.0, 2.0, False), BlowCountOfSlide(4.5, 2.0, True)]
    return [
        slide(NAMES[0], 0.13, 0.24, blow_count=counts[0], verdict="unknown_effect", factor=1.5),
        slide(NAMES[1], 0.14, 0.3, blow_count=counts[1]),
        slide(NAMES[2], 0.45, 0.17, kind="bound"),
    ]
