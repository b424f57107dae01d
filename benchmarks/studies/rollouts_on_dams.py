"""What a learned simulator says of the dams of the case histories, next to the solver.

    python -m benchmarks.studies.rollouts_on_dams [--model models/thrust]

Both at the same strengths and with the water that the model knows; no case history was learned
from. Prints the toes and the crest as a Markdown table.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.generated_pages import table
from benchmarks.studies.direct_on_dams import CASES, DAMS, Asked, compared
from geometry.case import load_case
from inversion.back_analysis.case import inversion_case
from inversion.engines.gns_engine import GNSEngine
from inversion.engines.registry import MPM
from inversion.engines.rollout_store import RolloutStore
from inversion.engines.run_store import RunStore
from inversion.engines.trained_model import Model, load_model
from pipeline.config import load_config

HEAD = ("dam", "points, m", "strengths, kPa", "number", "solver, m", "model, m", "off, m")


def lines(asked: Asked, model: Model) -> list[list[str]]:
    """Rows of a dam."""
    water = "pore_pressure" if model.simulator.config.thrust else "buoyant"
    config = load_config(None, [f"simulation.water={water}"])
    case = load_case(CASES / asked.case, config)
    setup = inversion_case(case, spacing_m=asked.spacing).setup
    requests = [setup.at(np.array(values)) for values in asked.strengths]
    engines = (MPM.forward(RunStore(None)), GNSEngine(RolloutStore(None), model))
    return compared(asked, setup, [engine.predict(requests) for engine in engines])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--model", default="models/thrust", metavar="DIR")
    model = load_model(parser.parse_args().model)
    rows = [row for asked in DAMS for row in lines(asked, model)]
    print(table(HEAD, rows, "lrllrrr"))


if __name__ == "__main__":
    main()
