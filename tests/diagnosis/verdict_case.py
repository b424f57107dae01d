"""Verdicts made by formula, for tests of the page: every kind of verdict, with every part of it.

A linear model of a slide: 27 surveyed points of the surface, toe, crest, two markers and a history
of the toe, one strength, ten effects with a smooth signature each. Scores, falls and evidence are
computed as the method has them, so the numbers of a page hang together as they do in a real one.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2 as chi2_law

from diagnosis.verdict.sections_file import save_sections
from diagnosis.verdict.verdict import CompareDocument, ExplainDocument, Verdict

NASTY = '<script>alert("1")</script> & $x_{1$ \\frac'
"""A name that must come out as text, on the page and in a picture."""

X = np.arange(20.0, 151.0, 5.0)
TIMES = np.array([2.0, 4.0, 6.0, 8.0, 12.0, 20.0])
STRENGTH = "residual_strength_1"
BASE_STRENGTH = 21.0

#: name -> (words, unit, low, high, kind); the signatures are below, in the same order.
EFFECTS = {
    "strain_softening": ("the liquefied soil loses strength as it shears", "kPa", 0, 40, "physics"),
    "rate_strengthening": ("fast shearing makes the soil stronger", "", 0, 0.4, "physics"),
    "overburden_strength": ("the strength grows with the overburden", "", 0, 1, "physics"),
    "weak_base": ("the mass slides on a weak base", "", 0, 1, "physics"),
    "shaking": ("the ground shakes while the mass slides", "m/s2", -3, 3, "physics"),
    "pore_pressure": ("excess pore pressure carries part of the weight", "", 0, 0.8, "physics"),
    "hydroplaning": ("the front glides on water", "", 0, 1, "physics"),
    "cracking": ("the crest cracks and cannot be pulled", "", 0, 1, "physics"),
    "pool_level": ("the pool stood higher or lower than reported", "m", -4, 4, "physics"),
    "datum_shift": ("the survey's datum is off", "m", -2, 2, "survey"),
}
FORBIDDEN = "side_shear"


@dataclass(frozen=True)
class Truth:
    """What the measurements of a made-up case were made with."""

    amplitudes: dict[str, float]
    pattern: float = 0.0
    seed: int = 3


def names() -> list[tuple[str, str, str, float | None, str]]:
    """(name, measurement, axis, place, role) of the measured numbers."""
    held = (X >= 80) & (X <= 95)
    profile = [
        (f"profile at x {x:g} m", "profile", "x_m", float(x), "held out" if out else "fitted")
        for x, out in zip(X, held, strict=True)
    ]
    single = ["upstream toe", "crest", "marker A dx", "marker A dy", "marker B dx", "marker B dy"]
    one = [(n, n.removesuffix(" dx").removesuffix(" dy"), "none", None, "fitted") for n in single]
    history = [
        (f"toe history at {t:g} s", "toe history", "time_s", float(t), "held out") for t in TIMES
    ]
    drawn = [("drawn crest", "drawn crest", "none", None, "constructed")]
    return [*profile, *one, *history, *drawn]


def bump(at: float, width: float) -> np.ndarray:
    """A smooth hump along the profile."""
    return np.exp(-(((X - at) / width) ** 2))


def columns() -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Derivative to ln S_r (m,), signature of a full amplitude by effect, standard deviations."""
    slope = -bump(45, 18) * 2.2 + bump(115, 20) * 2.6
    history = 1.0 - np.exp(-TIMES / 6.0)

    def full(profile: np.ndarray, single: list[float], late: np.ndarray) -> np.ndarray:
        return np.concatenate([profile, single, late, [single[1]]])

    strength = full(slope, [-14.0, -3.0, 4.0, -1.5, 2.5, -1.0], -14.0 * history)
    late = history**3
    shapes = {
        "strain_softening": full(
            bump(35, 12) * 3 - bump(95, 12) * 4, [6, 2, -3, 2, 1, 1], 6 * late
        ),
        "rate_strengthening": full(-bump(60, 25) * 1.5, [-3, -0.5, 2, 0, 2, 0], -5 * history**0.3),
        "overburden_strength": full(
            -bump(40, 10) * 3.5 + bump(75, 12) * 2.5, [-5, 2, 1, -2, 0, 1], -5 * history
        ),
        "weak_base": full(bump(35, 15) * 2 - bump(70, 16) * 2.4, [7, 1, -4, 1, -3, 0], 7 * history),
        "shaking": full(
            bump(50, 30) * 1.0 - bump(130, 8) * 2, [4, 3, -1, 2, -1, 1], 4 * history**2
        ),
        "pore_pressure": full(
            -bump(42, 11) * 3 + bump(78, 13) * 2.4, [-4, 2, 1, -2, 0, 1.2], -4.4 * history
        ),
        "hydroplaning": full(bump(25, 7) * 3 - bump(42, 7) * 1.5, [8, 0, -0.5, 0, 0, 0], 8 * late),
        "cracking": full(-bump(128, 5) * 5 + bump(120, 5) * 4, [0.4, 4, 0, 0, 0, 0], 0.4 * history),
        "pool_level": full(bump(30, 14) * 1.2, [2.5, 0.4, -1, 0.3, -1, 0], 2.5 * history),
        "datum_shift": full(np.ones_like(X), [0, -1, 0, 1, 0, 1], 0 * history),
    }
    std = full(np.full(len(X), 0.6), [1.2, 0.8, 0.5, 0.5, 0.5, 0.5], np.full(len(TIMES), 1.3))
    return strength, shapes, std


def surface() -> np.ndarray:
    """What the base model predicts at its start (m,)."""
    profile = np.interp(X, [20, 45, 110, 128, 150], [0.5, 6.0, 11.0, 20.0, 21.0])
    single = [32.0, 6.0, -18.0, -3.0, -9.0, -1.5]
    return np.concatenate([profile, single, 32.0 * (1 - np.exp(-TIMES / 6.0)), [6.0]])


class Case:
    """Measurements with a truth, and what the method makes of them."""

    def __init__(self, truth: Truth) -> None:
        random = np.random.default_rng(truth.seed)
        self.names = names()
        self.slope, self.shapes, self.std = columns()
        self.measured = surface() + self.std * random.standard_normal(len(self.std))
        for name, amplitude in truth.amplitudes.items():
            self.measured += amplitude / self.scale(name) * self.shapes[name]
        ripple = np.concatenate([np.sin(X / 4.0), np.zeros(len(self.std) - len(X))])
        self.measured += truth.pattern * ripple
        self.fitted = np.array([role == "fitted" for *_, role in self.names])
        self.held = np.array([role == "held out" for *_, role in self.names])
        self.scores = {name: self._score(name) for name in EFFECTS}
        self.order = sorted(EFFECTS, key=lambda name: -self.scores[name]["z"])

    @staticmethod
    def scale(name: str) -> float:
        """The amplitude of a full signature."""
        return 0.5 * EFFECTS[name][3]

    def white(self, values: np.ndarray) -> np.ndarray:
        """Fitted values in standard deviations."""
        return (values / self.std)[self.fitted]

    def fit(self, effects: list[str]) -> dict[str, Any]:
        """Least squares: ln S_r and the amplitudes."""
        made = [self.slope, *(self.shapes[name] / self.scale(name) for name in effects)]
        design = np.stack([self.white(column) for column in made], axis=1)
        target = self.white(self.measured - surface())
        found, *_ = np.linalg.lstsq(design, target, rcond=None)
        covariance = np.linalg.inv(design.T @ design)
        predicted = surface() + np.stack(made, axis=1) @ found
        residual = (self.measured - predicted) / self.std
        strength = BASE_STRENGTH * np.exp(found[0])
        return {
            "amplitudes": dict(zip(effects, map(float, found[1:]), strict=True)),
            "amplitude_std": dict(zip(effects, np.sqrt(np.diag(covariance))[1:], strict=True)),
            "values": {STRENGTH: float(strength)},
            "std": {STRENGTH: float(strength * np.sqrt(covariance[0, 0]))},
            "predicted": predicted,
            "residual": residual,
            "chi2": float((residual[self.fitted] ** 2).sum()),
            "dof": int(self.fitted.sum()) - 1 - len(effects),
            "held_out": float((residual[self.held] ** 2).sum()),
        }

    def signature(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Whitened signature of a full amplitude, whole and without what S_r imitates."""
        whole = self.white(self.shapes[name])
        known = self.white(self.slope)
        return whole, whole - known * (known @ whole) / (known @ known)

    def _score(self, name: str) -> dict[str, float]:
        whole, left = self.signature(name)
        residual = self.fit([])["residual"][self.fitted]
        z = float(left @ residual / np.linalg.norm(left))
        if EFFECTS[name][2] < 0:
            z = abs(z)
        return {
            "z": z,
            "amplitude": float(self.scale(name) * z / np.linalg.norm(left)),
            "visible": float(np.linalg.norm(left) / np.linalg.norm(whole)),
            "detectable": float(3.3 * self.scale(name) / np.linalg.norm(left)),
            "bias": float(100 * 3.3 / np.linalg.norm(left) * self._imitated(name)),
        }

    def _imitated(self, name: str) -> float:
        whole, known = self.white(self.shapes[name]), self.white(self.slope)
        return -float(np.clip((known @ whole) / (known @ known), -0.5, 0.5))

    def stage(self, effects: list[str]) -> dict[str, Any]:
        """`verdict.FittedModelSummary`."""
        made = self.fit(effects)
        p = float(chi2_law.sf(made["chi2"], made["dof"]))
        residual = made["residual"]
        groups, labels = [], [m for _, m, *_ in self.names]
        for name in dict.fromkeys(labels):
            own = np.array([label == name for label in labels]) & self.fitted
            if own.any():
                square, n = float((residual[own] ** 2).sum()), int(own.sum())
                groups.append(
                    {"name": name, "chi2": square, "expected": 0.95 * n, "n": n,
                     "z": (square - 0.95 * n) / np.sqrt(2.0 * n)}
                )  # fmt: skip
        best = max(range(len(X) - 4), key=lambda k: (residual[k : k + 5] ** 2).sum())
        square = float((residual[best : best + 5] ** 2).sum())
        held = int(self.held.sum())
        tests = [
            {"name": "chi2", "statistic": made["chi2"], "p": p},
            {"name": "autocorrelation", "statistic": 0.4 if p < 0.05 else 0.1,
             "p": 0.01 if p < 0.05 else 0.5},
            *({"name": f"group {g['name']}", "statistic": g["z"],
               "p": float(chi2_law.sf(g["chi2"], g["n"]))} for g in groups),
            {"name": "score", "statistic": self.scores[self.order[0]]["z"], "p": p},
        ]  # fmt: skip
        return {
            "effects": made["amplitudes"],
            "values": made["values"],
            "std": made["std"],
            "interval_95": {
                name: (value - 2 * made["std"][name], value + 2 * made["std"][name])
                for name, value in made["values"].items()
            },
            "chi2": made["chi2"], "dof": made["dof"],
            "p_combined": min(1.0, len(tests) * min(t["p"] for t in tests)),
            "tests": tests, "groups": groups,
            "window": {
                "measurement": "profile", "axis": "x_m", "first": self.names[best][0],
                "last": self.names[best + 4][0], "x_from": float(X[best]),
                "x_to": float(X[best + 4]), "n": 5, "chi2": square,
                "p": min(1.0, 23 * float(chi2_law.sf(square, 5)))},
            "held_out": {"chi2": made["held_out"], "n": held,
                         "p": float(chi2_law.sf(made["held_out"], held))},
            "asked": self.asked(made),
        }  # fmt: skip

    def asked(self, made: dict[str, Any]) -> list[dict[str, Any]]:
        """`verdict.AskedStrength` of every measurement that a halved strength moves enough."""
        found = []
        for key in dict.fromkeys((of, role) for _, of, *_, role in self.names):
            own = np.array([(of, role) == key for _, of, *_, role in self.names])
            slope, residual = (self.slope / self.std)[own], made["residual"][own]
            square = float(slope @ slope)
            if key[1] == "constructed" or np.sqrt(square) * np.log(2.0) < 1.0:
                continue
            log = np.log(made["values"][STRENGTH]) + float(slope @ residual) / square
            ends = np.clip(np.exp(log + np.array([0.0, -1.96, 1.96]) / np.sqrt(square)), 5, 90)
            value, low, high = map(float, ends)
            found.append({"parameter": STRENGTH, "measurement": key[0], "role": key[1],
                          "value": value, "interval_95": (low, high)})  # fmt: skip
        return found

    def named(self, effects: list[str], probability: float) -> dict[str, Any]:
        """`verdict.NamedSet`."""
        made = self.fit(effects)
        value, std = made["values"][STRENGTH], made["std"][STRENGTH]
        return {"names": effects, "probability": probability, "values": made["values"],
                "interval_95": {STRENGTH: (value - 1.96 * std, value + 1.96 * std)}}  # fmt: skip

    def quoted(self, effects: list[str]) -> dict[str, Any]:
        """`verdict.QuotedValue` of one model."""
        made, wide = self.fit(effects), {"50%": 0.67, "80%": 1.28, "95%": 1.96}
        return {
            name: {
                "value": value, "std": made["std"][name],
                "intervals": {
                    share: (value - k * made["std"][name], value + k * made["std"][name])
                    for share, k in wide.items()
                },
                "models": [self.named(effects, 1.0)],
            }
            for name, value in made["values"].items()
        }  # fmt: skip

    def step(self, number: int, model: str, effects: list[str], note: str) -> dict[str, Any]:
        """`verdict.WaterfallStep`."""
        made, base = self.fit(effects), self.fit([])
        return {
            "round": number, "hypothesis": model, "effects": made["amplitudes"],
            "values": made["values"], "std": made["std"], "chi2": made["chi2"],
            "dof": made["dof"], "held_out_chi2": made["held_out"],
            "held_out_n": int(self.held.sum()),
            "ln_evidence": 0.5 * (base["chi2"] - made["chi2"]) - 3.0 * len(effects), "note": note,
        }  # fmt: skip

    def candidates(self, refitted: int) -> list[dict[str, Any]]:
        """`verdict.CandidateVerdict`, best score first, and one that was forbidden."""
        base, found = self.fit([]), []
        for rank, name in enumerate(self.order):
            words, unit, *_, family = EFFECTS[name]
            score, refit = self.scores[name], None
            if rank < refitted and score["z"] > 1:
                made = self.fit([name])
                drop = base["chi2"] - made["chi2"]
                evidence = 0.5 * drop - 5.0
                why = (
                    {"kind": "small_gain", "numbers": [evidence, 2.3]} if evidence <= 2.3 else None
                )
                refit = {
                    "effects": made["amplitudes"], "amplitude": made["amplitudes"][name],
                    "std": made["amplitude_std"][name], "values": made["values"],
                    "chi2": made["chi2"], "drop": drop, "ln_evidence": evidence,
                    "held_out_chi2": made["held_out"], "accepted": not why, "why_not": why,
                }  # fmt: skip
            found.append(
                {"name": name, "family": family, "words": words, "unit": unit, "z": score["z"],
                 "expected_drop": max(score["z"], 0.0) ** 2,
                 "p_family": float(min(1.0, 10 * chi2_law.sf(max(score["z"], 0.0) ** 2, 1))),
                 "amplitude_by_score": score["amplitude"], "visible_fraction": score["visible"],
                 "smallest_detectable": score["detectable"],
                 "strength_bias_if_missed": {STRENGTH: score["bias"]},
                 "resolved": name != "cracking", "refit": refit, "left_out": ""}
            )  # fmt: skip
        keys = ("z", "expected_drop", "p_family", "amplitude_by_score", "visible_fraction",
                "smallest_detectable", "resolved", "refit")  # fmt: skip
        found.append(
            {"name": FORBIDDEN, "family": "physics", "words": "the sides of the slide hold it back",
             "unit": "kPa", "strength_bias_if_missed": {}, "left_out": "ruled out by the engineer",
             **dict.fromkeys(keys)}
        )  # fmt: skip
        return found

    def confounding(self) -> dict[str, Any]:
        """`verdict.Confounding`."""
        unit = [self.signature(name)[1] for name in self.order]
        unit = [left / np.linalg.norm(left) for left in unit]
        return {"names": self.order, "cosine": (np.array(unit) @ np.array(unit).T).tolist()}

    def signatures(self) -> dict[str, Any]:
        """`verdict.Signatures`: three amplitudes of each."""
        known, entries = self.white(self.slope), []
        for name in self.order:
            shape = self.shapes[name]
            share = (known @ self.white(shape)) / (known @ known)
            for part in (0.5, 1.0, 2.0):
                entries.append(
                    {"name": name, "amplitude": part * self.scale(name),
                     "change": (part * shape).tolist(),
                     "standardised": (part * shape / self.std).tolist(),
                     "left_after_refit": (part * (shape - share * self.slope) / self.std).tolist()}
                )  # fmt: skip
        return {"names": self.order, "measurements": [n for n, *_ in self.names],
                "entries": entries}  # fmt: skip

    def measurements(self, effects: list[str]) -> list[dict[str, Any]]:
        """`verdict.MeasurementVerdict`."""
        base, final = self.fit([]), self.fit(effects)
        return [
            {"name": name, "measurement": of, "axis": axis, "place": place, "unit": "m",
             "measured": float(self.measured[k]), "std_total": float(self.std[k]),
             "std_survey": 0.8 * float(self.std[k]),
             "predicted_base": float(base["predicted"][k]),
             "predicted_final": float(final["predicted"][k]),
             "residual_base": float(base["residual"][k]),
             "residual_final": float(final["residual"][k]), "role": role}
            for k, (name, of, axis, place, role) in enumerate(self.names)
        ]  # fmt: skip

    def hidden(self) -> dict[str, dict[str, float]]:
        """Bias of S_r that each effect hides while undetected [%]."""
        return {STRENGTH: {name: self.scores[name]["bias"] for name in self.order}}


PARAMETERS = [
    {"name": STRENGTH, "words": "S_r of the hydraulic fill", "unit": "kPa", "strength": True,
     "low": 5.0, "high": 90.0}
]  # fmt: skip
RUNS = {"asked": 128, "computed": 96, "allowed": 250, "cut_short": []}
HASHES = {"scene": "5f0c1a92d3e4", "measurements": "a1b2c3d4e5f6", "question": "99aa88bb77cc"}
MANIFEST = {
    "version": "0.1.0",
    "seeds": {"jitter": [0, 1, 2, 3], "null": 20260101},
    "settings": {"spacing_m": 4.0, "replicates": 8},
    "machine": {"cores": 2},
}


def document(case: Case, kind: str, effects: list[str], title: str, **more: Any) -> dict[str, Any]:
    """A verdict as a dictionary."""
    made = case.fit(effects)
    answered = [
        {"name": name, "amplitude": made["amplitudes"][name],
         "std": float(made["amplitude_std"][name]),
         "interval_95": (
             max(EFFECTS[name][2], made["amplitudes"][name] - 2 * made["amplitude_std"][name]),
             made["amplitudes"][name] + 2 * made["amplitude_std"][name]),
         "unit": EFFECTS[name][1], "words": EFFECTS[name][0]}
        for name in effects
    ]  # fmt: skip
    steps = [case.step(0, "base", [], "calibrated")]
    for number, _ in enumerate(effects):
        note = f"added {effects[number]}"
        steps.append(case.step(number + 1, f"with_{effects[number]}", effects[: number + 1], note))
    return {
        "case": "no_such_case", "title": title, "verdict": kind,
        "tested": list(case.order), "forbidden": [FORBIDDEN],
        "answer": {"effects": answered, "set_90": [case.named(effects, 0.96)]},
        "parameters": PARAMETERS, "base": case.stage([]), "final": case.stage(effects),
        "quoted": case.quoted(effects), "steps": steps,
        "candidates": case.candidates(4), "confounding": case.confounding(),
        "signatures": case.signatures(), "measurements": case.measurements(effects),
        "hidden": case.hidden(), "unknown_curve": None, "next_measurement": [], "runs": RUNS,
        "seconds": 512.0, "hashes": HASHES, "manifest": MANIFEST, **more,
    }  # fmt: skip


def identified(title: str = "A dam") -> Verdict:
    """One effect is named."""
    case = Case(Truth({"strain_softening": 17.0}))
    made = document(case, "identified", ["strain_softening"], title)
    made["answer"]["chance"] = 0.88
    return Verdict.model_validate(made)


def adequate() -> Verdict:
    """Nothing to find."""
    made = document(Case(Truth({})), "adequate", [], "A sound model")
    made["answer"]["set_90"] = [Case(Truth({})).named([], 0.97)]
    return Verdict.model_validate(made)


def ambiguous() -> Verdict:
    """Two effects look alike; a measurement would tell them apart."""
    case = Case(Truth({"pore_pressure": 0.45}))
    best = ["pore_pressure"]
    made = document(case, "ambiguous", best, "Two that look alike")
    made["answer"]["set_90"] = [
        case.named(["pore_pressure"], 0.56),
        case.named(["overburden_strength"], 0.39),
    ]
    made["answer"]["chance"] = 0.38
    made["next_measurement"] = [
        {"name": "marker at x 62 m, y 4 m", "gain": 11.3, "parts": ["dx", "dy"], "unit": "m",
         "words": "displacement of a point at x 62 m, y 4 m before the slide, to 0.3 m",
         "outcomes": [
             {"names": ["pore_pressure"], "values": [21.04, -3.2], "std": [0.62, 0.31]},
             {"names": ["overburden_strength"], "values": [18.9, -3.1], "std": [0.58, 0.3]},
         ]},
        {"name": "toe history", "gain": 4.1, "words": "where the toe is after 5 s, to 1 m"},
    ]  # fmt: skip
    made["refutation"] = made["next_measurement"][0]
    return Verdict.model_validate(made)


def unknown() -> Verdict:
    """A misfit that no effect of the list explains, with the curve that would."""
    case = Case(Truth({}, pattern=1.4))
    curve = {
        "variable": "strain_rate", "words": "rate of shearing", "unit": "log10 of 1/s",
        "knots": [-2.0, -1.25, -0.5, 0.25, 1.0], "multiplier": [0.7, 0.8, 1.1, 1.6, 1.9],
        "low": [0.5, 0.7, 1.0, 1.3, 1.2], "high": [1.0, 0.95, 1.25, 2.0, 3.0],
        "chi2": {"strain_rate": 34.0, "overburden": 61.0, "time": 70.5},
        "ln_evidence": {"strain_rate": 12.0, "overburden": 1.0, "time": -2.0},
    }  # fmt: skip
    made = document(case, "unknown_effect", [], "Outside the list", unknown_curve=curve)
    made["answer"]["set_90"] = []
    return Verdict.model_validate(made)


def least() -> Verdict:
    """A verdict in which everything that may be missing is missing."""
    made = document(Case(Truth({})), "suspect", [], "Least")
    stage = {**made["base"], "window": None, "tests": [], "groups": [],
             "held_out": {"chi2": 0.0, "n": 0, "p": None}}  # fmt: skip
    number = {**made["measurements"][len(X)], "predicted_base": None, "predicted_final": None,
              "residual_base": None, "residual_final": None}  # fmt: skip
    made |= {
        "base": stage, "final": stage, "quoted": {}, "candidates": [], "hidden": {}, "steps": [],
        "confounding": {"names": [], "cosine": []}, "measurements": [number], "forbidden": [],
        "signatures": {"names": [], "measurements": [], "entries": []}, "tested": [],
        "hashes": {}, "manifest": {},
    }  # fmt: skip
    made["answer"]["set_90"] = []
    return Verdict.model_validate(made)


def compared() -> CompareDocument:
    """What `compare` leaves."""
    verdict = identified()
    lines = [
        m.model_copy(update={"predicted_final": None, "residual_final": None})
        for m in verdict.measurements
    ]
    return CompareDocument(
        case=verdict.case, title=verdict.title, alarm="alarm",
        parameters=verdict.parameters, base=verdict.base,
        measurements=lines, runs=verdict.runs,
    )  # fmt: skip


def explained() -> ExplainDocument:
    """What `explain` leaves."""
    v = identified()
    candidates = [c.model_copy(update={"refit": None}) for c in v.candidates]
    return ExplainDocument(
        case=v.case, title=v.title, base=v.base, parameters=v.parameters, candidates=candidates,
        confounding=v.confounding, signatures=v.signatures,
        hidden=v.hidden, runs=v.runs,
    )  # fmt: skip


def save_section(folder: Path) -> Path:
    """Points of the section before and after, next to a verdict of this case."""
    ground = np.array([[-20.0, 0.0], [60.0, 1.0], [200.0, 1.0]])

    def points(x: list[float], y: list[float]) -> tuple[np.ndarray, np.ndarray]:
        places, heights = np.meshgrid(np.arange(-18.0, 190.0, 1.0), np.arange(0.5, 26.0, 1.0))
        top = np.interp(places, x, y, left=-1.0, right=-1.0)
        inside = (heights < top) & (heights > np.interp(places, *ground.T))
        return np.stack([places[inside], heights[inside]], axis=1), np.ones(inside.sum())

    initial = points([45, 95, 110, 160, 185], [1, 22, 22, 21, 1])
    after = [points([at, 45, 110, 128, 150, 185], [0.5, 6, 11, 20, 21, 1]) for at in (10, 15)]
    return save_sections(
        folder, initial=initial, base=after[0], final=after[1], spacing=1.0, ground=ground,
        toes={"upstream toe": (47.0, -1.0)},
    )  # fmt: skip
