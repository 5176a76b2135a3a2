from collections import Counter
from itertools import combinations, permutations

import numpy as np
import pytest

import screwgauge
from support.command import loaded_after
from support.machines import Believed, align, assign, load_side, machine_of, misfits
from support.mechanism import load_mechanism
from support.models import write_models

#: Mechanisms with loops of all kinds of joints, and the links that they consist of.
LINKS = {
    "3-rps": "PPPRRRSSS",
    "3ups-upu-s": "PPPPSSSSUUUUU",
    "spatial-slider-crank": "PRSU",
    "double-cardan": "RRUU",
    "delta": "RRRSSSSSSUUUUUU",
    "screw-press": "CPRRS",
    "arm7": "RRRRRRR",
}
#: Lengths of the machine, or rad.
SAME = 1e-9


def files(name, folder):
    write_models(load_mechanism(name), folder)
    return [name, *(folder / f"{name}{end}" for end in (".urdf", ".xml", "-full.urdf", "-full.xml"))]


@pytest.mark.parametrize("name", LINKS)
def test_every_cut_and_format_of_a_mechanism_is_one_machine(name, tmp_path):
    machines = [machine_of(load_side(file).reading) for file in files(name, tmp_path)]
    for machine in machines:
        assert "".join(sorted(link.kind for link in machine.links)) == LINKS[name]
    for a, b in combinations(machines, 2):
        found = align(a, b, {}, {}, Believed.SIMILAR)
        assert found.complete
        for pair in found.bodies.items():
            assert misfits(a, b, pair, found.placed[pair[0]]).max() < SAME


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart", "screw-press", "spatial-slider-crank"])
def test_models_of_a_mechanism_in_every_cut_and_format_are_the_same(name, tmp_path):
    verdicts = Counter(screwgauge.diagnose(a, b).same for a, b in combinations(files(name, tmp_path), 2))
    assert verdicts == {True: 10}


@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (2, 5), (5, 2), (4, 4)])
def test_an_assignment_has_the_least_cost_of_all(shape):
    drawn = np.random.default_rng(shape)
    for cost in (drawn.normal(size=shape), drawn.integers(0, 3, shape).astype(float)):
        pairs = assign(cost)
        few, many = sorted(shape)
        table = cost if shape[0] == few else cost.T
        least = min(sum(table[i, j] for i, j in enumerate(some)) for some in permutations(range(many), few))
        assert len(pairs) == len({i for i, _ in pairs}) == len({j for _, j in pairs}) == few
        assert sum(cost[pair] for pair in pairs) == pytest.approx(least)


def test_pairs_without_a_finite_cost_are_assigned_last():
    assert assign(np.array([[np.nan, 1.0], [np.inf, 2.0]])) == [(0, 1), (1, 0)]
    assert assign(np.array([[np.nan, 1.0, 3.0], [np.inf, 2.0, 3.0]])) == [(0, 1), (1, 2)]


def test_scipy_is_imported_only_where_rows_compete():
    code = "import numpy as np; from screwgauge.diagnosis.machine.alignment import assign; assign(np.array({}))"
    assert loaded_after(code.format([[0.0, 1.0], [1.0, 0.0]]), "scipy") == set()
    assert loaded_after(code.format([[0.0, 1.0], [0.0, 3.0]]), "scipy") == {"scipy"}
