"""Certified answers; imports flint."""

from screwgauge import Results
from screwgauge.truth import exact, forces, samples
from screwgauge.truth.exact import drive, number, read_terms, widen_decimals
from screwgauge.truth.forces import newton_euler, required_wrenches, unknowns
from screwgauge.truth.kinematics import Certifier, NotCertified, State, state
from screwgauge.truth.linkage import Linkage
from screwgauge.truth.samples import Sampler


def notes(results: Results) -> str:
    return " ".join(results.solutions["truth"].notes)
