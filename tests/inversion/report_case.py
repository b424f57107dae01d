"""A result made by hand, for tests of the report: every part of it, or nearly none."""

from __future__ import annotations

from typing import Any

from inversion.back_analysis.result import Result

NASTY = '<script>alert("1")</script> & $x_{1$ \\frac'
"""A name that must come out as text, on the page and in a picture."""


def parameter(name: str, **more: Any) -> dict[str, Any]:
    """A strength that is well determined."""
    return {
        "name": name, "label": f"S_r of {name}", "zones": ["1"],
        "property": "residual_strength_kpa",
        "unit": "kPa", "value": 27.5, "start": 30.0, "low": 5.0, "high": 90.0, "std_data": 1.5,
        "std_by_source": {"pool level": 0.5}, "std_total": 1.6, "interval_95": [24.0, 31.0],
        "equally_good_range": None, "at_bound": None, "determined": True, "prior_std": 21.0,
        "has_prior": False, "sigma_v0_kpa": 150.0, "sigma_v0_std_kpa": 60.0, "ratio": 0.183,
        "ratio_std": 0.011, **more,
    }  # fmt: skip


def friction(name: str = "friction_7") -> dict[str, Any]:
    """An angle that the data say nothing of."""
    return parameter(
        name, label="friction angle of the rolled fill", zones=["7"], property="friction_deg",
        unit="deg", value=30.0, low=27.0, high=37.0, std_data=2.9, std_by_source={},
        std_total=2.9, interval_95=[27.0, 36.0], determined=False, prior_std=2.9,
        sigma_v0_kpa=None, sigma_v0_std_kpa=None, ratio=None, ratio_std=None,
    )  # fmt: skip


def measurement(name: str, **more: Any) -> dict[str, Any]:
    """A toe that was fitted."""
    return {
        "name": name, "group": name, "type": "toe_runout", "unit": "m", "measured": 53.0,
        "low": 42.0, "high": 65.0, "std": 5.75, "predicted": 53.1, "predicted_at_start": -0.4,
        "difference_in_std": 0.02, "role": "fitted", "confidence": "paper", "source": "a paper",
        "by_eye": 55.2, **more,
    }  # fmt: skip


def document(parameters: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """The least a result can be: an answer, two looks, one measurement."""
    names = [p["name"] for p in parameters]
    values = {p["name"]: p["value"] for p in parameters}
    keys = ("name", "label", "zones", "property", "start", "low", "high")
    looks = [("start", 30.0, 86.0, 43.7), ("gauss_newton", 27.5, 0.01, 53.1)]
    return {
        "case": "no_such_case", "title": "A Dam", "measurement_set": "field", "engine": "mpm",
        "spacing_m": 2.0, "coarse_spacing_m": None, "manifest": {}, "question": {
            "parameters": [{key: p[key] for key in keys} for p in parameters]},
        "answer": {
            "parameters": parameters, "loss": 0.01, "loss_unit": "m2", "tolerance": 0.1,
            "reached": True, "method": "gauss_newton", "words": "loss below the tolerance",
            "correlation": {"names": names, "matrix": [[1.0] * len(names)] * len(names)},
            "undetermined": [], "equally_good": [], "derivative": {}, "steps": {},
            "derivative_resolved": {}},
        "iterations": [
            {"iteration": number, "kind": kind, "spacing_m": 2.0, "accepted": True,
             "values": {**values, names[0]: value}, "loss": loss,
             "predicted": {"upstream toe": runout}, "runs_so_far": 4 * number + 1, "seconds": 1.0}
            for number, (kind, value, loss, runout) in enumerate(looks)],
        "starts": [], "variants": [], "sensitivities": [],
        "measurements": [measurement("upstream toe")], "noise": None, "classical": [],
        "remarks": [], "published": {}, "timings": {}, "runs": 9, "runs_to_answer": 9, **more,
    }  # fmt: skip


def least() -> Result:
    """A result without classical methods, variants, sensitivities, published values."""
    return Result.model_validate(document([parameter("residual_strength_1")]))


def full(name: str = "the fill") -> Result:
    """A result with every part; `name` is found in labels, names and sources."""
    strength = parameter("residual_strength_1", label=f"S_r of {name}")
    values = {"residual_strength_1": 51.0, "friction_7": 30.0}
    zero = {"residual_strength_1": 0.0, "friction_7": 0.0}
    change = {**zero, "residual_strength_1": -0.8}
    side = {"words": f"pool of {name}", "spacing_m": 2.0, "values": values, "change": change,
            "coarse_change": change, "ratio_change": {}, "predicted_before": {}, "predicted": {},
            "loss": 0.01, "reached": False}  # fmt: skip
    sensitivity = {"words": name, "change": change, "std": change | {"residual_strength_1": 0.8}}
    made = document(
        [strength, friction()],
        title=name,
        coarse_spacing_m=4.0,
        starts=[{"start": values, "answer": values, "loss": 0.01, "reached": True, "iterations": 2,
                 "runs": 9, "words": "done", "spacing_m": 4.0}] * 2,
        variants=[{"name": f"without {name}", "words": "no water", "spacing_m": 4.0,
                   "values": values, "coarse_values": values,
                   "ratios": {"residual_strength_1": 0.17}, "loss": 0.02, "reached": True,
                   "predicted": {"upstream toe": 53.0, "freeboard": -2.2},
                   "measured": {"upstream toe": 53.0}, "at_bound": ["friction_7"],
                   "words_end": "done"}],
        sensitivities=[
            sensitivity | {"name": f"level of {name}", "kind": "water_level", "sides": [side] * 2},
            sensitivity | {"name": "upper toe", "kind": "target", "sides": [side]}],
        waterfall={"parameter": "residual_strength_1",
                   "stated": {"name": f"paper of {name}", "value": 18.9, "source": name},
                   "bars": [{"name": f"{what} of {name}", "words": name, "case": "no_such_case",
                             "spacing_m": 4.0, "value": value, "loss": 0.01, "reached": reached,
                             "predicted": {"upstream toe": 53.0, "freeboard": -2.0},
                             "at_bound": bound}
                            for what, value, reached, bound in (
                                ("base", 51.0, True, None), ("water", 90.0, False, "high"),
                                ("answer", 27.5, True, None))]},
        noise={"spacing_m": 4.0, "jitter": 0.5, "seeds": [1, 2], "std": {}, "mean": {},
               "answers": [], "answer_std": zero},
        measurements=[
            measurement("upstream toe", source=name),
            measurement("freeboard", type="freeboard", measured=1.5, low=1.0, high=2.0, std=0.5,
                        predicted=-3.9, difference_in_std=-10.8, role="held out", by_eye=None),
            measurement("crest", type="crest_settlement", measured=20.0, std=1.0, predicted=21.0,
                        difference_in_std=1.0, role="compared", by_eye=None, low=None, high=None),
            *(measurement(f"profile at x {x} m", group="profile", type="surface_profile",
                          role="constructed", confidence="constructed", difference_in_std=0.5,
                          by_eye=None, source=name) for x in (1, 2)),
        ],
        classical=[{"name": "upstream", "side": "left", "labels": [f"slip surface of {name}"],
                    "methods": [
                        {"title": f"Kinetics of {name}", "value_kpa": 31.3, "low_kpa": 24.6,
                         "high_kpa": 45.4},
                        {"title": "ZIF", "value_kpa": None, "low_kpa": None, "high_kpa": None}]}],
        relations=[{
            "parameter": "residual_strength_1", "relation": "weber_2015",
            "label": f"Weber of {name}", "zones": ["1"], "n1_60": 12.9,
            "n1_60_of_zones": {"1": 12.9}, "clean_sand": True, "other_kind": True, "beyond": True,
            "confidence": ["recalled"], "sigma_v0_kpa": 145.0, "value_kpa": 22.8, "low_kpa": 15.3,
            "weakest_kpa": 22.8, "strongest_kpa": 22.8,
            "high_kpa": 34.0, "scatter": "assumed"}],
        published={"olson_stark_2002": {"value": 18.7, "low": 15.8, "high": 21.8,
                                        "confidence": "published"},
                   "weber_2015_imm": {"value": 25.8, "confidence": "recalled"},
                   "elsewhere_2001": {"value": 77.7, "zones": ["9"]}},
        remarks=[f"no cell size for {name}"],
        timings={"answer": 1.0, "in all": 2.0},
        manifest={"machine": {"cores": 2}, "config": {"simulation": {"courant": 0.3}}},
    )  # fmt: skip
    answer = made["answer"]
    answer["undetermined"] = [
        {
            "direction": {"residual_strength_1": 0.0, "friction_7": 1.0},
            "words": f"{name}: the data say nothing of it",
            "remaining": 1.0,
        }
    ]
    answer["equally_good"] = [{"along": 0, "spacing_m": 4.0, "values": {"residual_strength_1": 27.0,
                               "friction_7": 37.0}, "predicted": {"upstream toe": 53.0},
                               "loss": 0.01, "at_bound": ["friction_7"]}]  # fmt: skip
    return Result.model_validate(made)
