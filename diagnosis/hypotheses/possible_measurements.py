"""What could be measured next: places and times on a section, as measurements without a value.

In: the section and what was measured. Out: `Measured` entries, one for each thing a surveyor could
go and read, as the types of measurement propose them (`Measured.could_be_made`): the surface at a
place, the displacement of a stake, the toe at a time (from a film, a tide gauge, a witness), how
long it took, how high the remnant stands. What has been measured already is not among them.
"""

from __future__ import annotations

from diagnosis.hypotheses.model import Proposal
from geometry.survey.measured import Measured
from geometry.survey.registry import measurement_types
from geometry.survey.site import Site
from inversion.estimation.forward import SectionSetup
from pipeline.units import with_signs


def site_of(setup: SectionSetup) -> Site:
    """The section and the measurements that were made on it, without constructed ones."""
    made = [entry for entry in setup.targets.entries if not entry.constructed]
    return Site(setup.scene, setup.foot, made, setup.settings.gravity_m_per_s2)


def possible_measurements(setup: SectionSetup) -> list[Measured]:
    """Measurements that could still be made on a section."""
    site = site_of(setup)
    return [entry for kind in measurement_types().values() for entry in kind.could_be_made(site)]


def proposal_of(entry: Measured, first: int) -> Proposal:
    """A measurement as the statistics see it.

    Args:
        entry: the measurement.
        first: place of its first number among those of all proposals.
    """
    name = " ".join([entry.name, *(part for part in entry.parts if len(entry.parts) == 1 and part)])
    return Proposal(
        name=name,
        words=f"{name}, to {entry.std:g} {with_signs(entry.unit)}",
        index=tuple(range(first, first + len(entry.values))),
        covariance=entry.covariance(),
        parts=tuple(entry.parts) if len(entry.values) > 1 else (),
        unit=entry.unit,
    )
