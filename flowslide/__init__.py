"""The face of the tool: what notebooks, web pages and the command line call.

In: case folders and settings. Out: scenes, runs, answers, verdicts and reports.

    import flowslide

    result = flowslide.back_analyse("lower_san_fernando", spacing_m=3.0, quick=True)

`flowslide.api` has the functions and what they share; nothing heavy is imported before one of them
is used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flowslide.api import (
        Cancelled,
        InputError,
        Simulation,
        Simulation3d,
        WorkFailed,
        back_analyse,
        back_analyse_3d,
        classical,
        compare,
        diagnose,
        explain,
        load_case,
        load_settings,
        posterior,
        predict,
        predict_3d,
        predict_from_blow_counts,
        simulate,
        simulate_3d,
        write_pdf,
        write_report,
    )

__all__ = [
    "Cancelled",
    "InputError",
    "Simulation",
    "Simulation3d",
    "WorkFailed",
    "back_analyse",
    "back_analyse_3d",
    "classical",
    "compare",
    "diagnose",
    "explain",
    "load_case",
    "load_settings",
    "posterior",
    "predict",
    "predict_3d",
    "predict_from_blow_counts",
    "simulate",
    "simulate_3d",
    "write_pdf",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("flowslide.api"), name)
    raise AttributeError(f"module 'flowslide' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
