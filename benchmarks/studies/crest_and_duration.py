"""What would let the crest of Lower San Fernando sink 20 m and its slide take 40 s.

    python -m benchmarks.studies.crest_and_duration [--spacing 2] [--write]

Each model has effects in addition to the base model, and an S_r for which the toe runs as far as
measured. What it then says of crest, freeboard and duration was not fitted. Runs are kept in
`results/benchmarks/crest_and_duration`; `--write` renews the table of `docs/method/effects.md`.
"""

from __future__ import annotations

from collections.abc import Sequence

from scipy.optimize import brentq

from benchmarks.generated_pages import EFFECTS_PAGE, ROOT, renew, table
from diagnosis.case import diagnosis_case
from diagnosis.hypotheses.hypothesis_file import Hypothesis, HypothesisEffect
from geometry.case import load_case
from inversion.engines.run_store import RunStore
from inversion.problem.state import State
from pipeline.cli import base_parser, main_exit

CASE = ROOT / "case_histories" / "lower_san_fernando"
FOLDER = ROOT / "results/benchmarks/crest_and_duration"
TOE, SHOWN = "upstream toe", ("crest", "freeboard", "duration")
RANGE_KPA, WITHIN_KPA = (4.0, 45.0), 0.15
DRAINED = {"peak_ratio": 0.0, "peak_friction_deg": 33.0}
CREST_M = 176.0
"""Back of the liquefied fill, under the crest."""

Effects = dict[str, dict[str, float]]

MODELS: tuple[tuple[str, Effects], ...] = (
    ("base model", {}),
    ("strength falls in 15 s", {"late_liquefaction": {"amplitude": 15.0}}),
    ("strength falls in 40 s", {"late_liquefaction": {"amplitude": 40.0}}),
    ("... drained before", {"late_liquefaction": {"amplitude": 40.0, **DRAINED}}),
    ("front from the toe, 7 m/s", {"spreading_liquefaction": {"amplitude": 0.15}}),
    ("front from the toe, 2 m/s", {"spreading_liquefaction": {"amplitude": 0.5}}),
    ("... drained before", {"spreading_liquefaction": {"amplitude": 0.5, **DRAINED}}),
    ("front from below the crest, 2 m/s",
     {"spreading_liquefaction": {"amplitude": 0.5, "from_x_m": CREST_M}}),
    ("viscous, 15 kPa s", {"bingham": {"amplitude": 15.0}}),
    ("apparent cohesion of 10 kPa", {"apparent_cohesion": {"amplitude": 10.0}}),
    ("core and rolled fill lose 40 %", {"remoulding": {"amplitude": 0.4}}),
    ("core and rolled fill lose 70 %", {"remoulding": {"amplitude": 0.7}}),
    ("core and rolled fill lose 90 %", {"remoulding": {"amplitude": 0.9}}),
    ("70 %, and strength falls in 15 s",
     {"remoulding": {"amplitude": 0.7}, "late_liquefaction": {"amplitude": 15.0}}),
    ("70 %, and front from the toe, 2 m/s",
     {"remoulding": {"amplitude": 0.7}, "spreading_liquefaction": {"amplitude": 0.5}}),
)  # fmt: skip
"""In words, and as in a scene."""


def fitted(effects: Effects, spacing: float, store: RunStore) -> tuple[float, dict[str, float]]:
    """S_r [kPa] for which the toe is as measured, and all readings by name."""
    added = {
        name: HypothesisEffect(
            amplitude=numbers["amplitude"],
            parameters={key: value for key, value in numbers.items() if key != "amplitude"},
        )
        for name, numbers in effects.items()
    }
    hypothesis = Hypothesis(effects=added)
    model = diagnosis_case(load_case(CASE), spacing_m=spacing, hypothesis=hypothesis).model(store)
    names = list(model.targets.names)
    measured = next(e.value_m for e in model.targets.entries if e.name == TOE)

    def readings(strength: float) -> dict[str, float]:
        (values,) = model.predict([State((strength,))])
        return dict(zip(names, values.tolist(), strict=True))

    strength = brentq(lambda s: readings(s)[TOE] - measured, *RANGE_KPA, xtol=WITHIN_KPA)
    return strength, readings(strength)


def row(words: str, strength: float, found: dict[str, float]) -> list[str]:
    """A model as cells."""
    return [words, f"{strength:.1f}", *(f"{found[name]:.1f}" for name in SHOWN)]


def main(argv: Sequence[str] | None = None) -> int:
    """Fit, print, and where asked renew the page."""
    parser = base_parser("python -m benchmarks.studies.crest_and_duration",
                         "Crest and duration of Lower San Fernando with each effect.")  # fmt: skip
    parser.add_argument("--spacing", type=float, default=2.0, help="of points [m]; default: 2")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="renew docs/method/effects.md")
    options = parser.parse_args(argv)
    store, rows = RunStore(FOLDER, threads=options.threads), []
    for words, effects in MODELS:
        rows.append(row(words, *fitted(effects, options.spacing, store)))
        print("  ".join(rows[-1]), flush=True)
    rows.append(["**measured**", "", "20 ± 1", "1.5 ± 0.5", "40 ± 10"])
    if options.write:
        header = ("with", "S_r (kPa)", "crest (m)", "freeboard (m)", "duration (s)")
        renew(EFFECTS_PAGE, late=table(header, rows, "lrrrr"))
    return 0


if __name__ == "__main__":
    main_exit(main)
