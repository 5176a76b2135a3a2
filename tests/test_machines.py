"""A machine is the same machine wherever its file cuts loops, whatever it calls its parts, in whichever pose."""

from __future__ import annotations

from collections import Counter
from itertools import combinations, permutations

import numpy as np
import pytest

import screwgauge
from support.command import printed_by
from support.machines import BELIEVED, align, assign, load_side, machine_of, misfits
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

MATTER = '<inertial pos="{} 0.02 0.1" mass="{}" diaginertia="0.01 0.02 0.02"/>'
#: A four-bar of three bodies in the x-z plane, its joints a to d in order around the loop.
ROD = '<body name="rod" pos="0 0 0.2"><joint name="b" axis="0 1 0"/>' + MATTER.format(0.2, 2) + "</body>"
CUT_AT_C = (
    '<mujoco><worldbody><body name="crank"><joint name="a" axis="0 1 0"/>'
    + MATTER.format(0.1, 1)
    + ROD
    + '</body><body name="rocker" pos="0.4 0 0"><joint name="d" axis="0 1 0" {d}/>'
    + MATTER.format(0.05, 3)
    + '</body></worldbody><equality><connect name="c.1" body1="rod" body2="rocker" anchor="0.5 0.1 0.1"/>'
    '<connect name="c.2" body1="rod" body2="rocker" anchor="0.5 -0.1 0.1"/></equality></mujoco>'
)
CUT_AT_D = (
    '<mujoco><worldbody><body name="kurbel"><joint name="eins" axis="0 1 0"/>'
    + MATTER.format(0.1, 1)
    + '<body name="koppel" pos="0 0 0.2"><joint name="zwei" axis="0 1 0"/>'
    + MATTER.format(0.2, 2)
    + '<body name="schwinge" pos="0.4 0 -0.2"><joint name="drei" axis="0 -1 0" pos="0.1 0 0.3"/>'
    + MATTER.format(0.05, "{mass}")
    + '</body></body></body></worldbody><equality><connect name="x" body1="schwinge" anchor="0 0.1 0"/>'
    '<connect name="y" body1="schwinge" anchor="0 -0.1 0"/></equality></mujoco>'
)


def files(name, folder):
    write_models(load_mechanism(name), folder)
    return [name, *(folder / f"{name}{end}" for end in (".urdf", ".xml", "-full.urdf", "-full.xml"))]


@pytest.mark.parametrize("name", LINKS)
def test_every_cut_and_format_of_a_mechanism_is_one_machine(name, tmp_path):
    machines = [machine_of(load_side(file).reading) for file in files(name, tmp_path)]
    for machine in machines:
        assert "".join(sorted(link.kind for link in machine.links)) == LINKS[name]
    for a, b in combinations(machines, 2):
        found = align(a, b, {}, {}, BELIEVED[0])
        assert found.covers(a, b)
        for pair in found.bodies.items():
            assert misfits(a, b, pair, found.placed[pair[0]]).max() < SAME


@pytest.mark.sampled(4)
@pytest.mark.slow
@pytest.mark.parametrize("name", ["3ups-upu-s", "stewart", "screw-press", "spatial-slider-crank"])
def test_models_of_a_mechanism_in_every_cut_and_format_are_the_same(name, tmp_path):
    verdicts = Counter(screwgauge.diagnose(a, b).same for a, b in combinations(files(name, tmp_path), 2))
    assert verdicts == {True: 10}


@pytest.fixture
def four_bars(write):
    """The same four-bar, cut at its third joint and, by other names, at its fourth."""

    def of(d="", mass=3):
        return write("c.xml", CUT_AT_C.format(d=d)), write("d.xml", CUT_AT_D.format(mass=mass))

    return of


def test_a_loop_that_is_cut_elsewhere_by_other_names_is_the_same_loop(four_bars):
    for pair in (four_bars(), four_bars()[::-1]):
        found = screwgauge.diagnose(*pair)
        assert found.same, found.verdict
        assert found.found.mobility == (1, 1)


@pytest.mark.parametrize("turned", [False, True])
def test_what_else_differs_is_named_across_cuts(turned, four_bars):
    a, b = four_bars(mass=3.5)[:: -1 if turned else 1]
    found = screwgauge.diagnose(a, b)
    (said,) = found.differences
    assert said.what == "mass"
    assert {said.item_a, said.item_b} <= {"rocker", "schwinge"}
    assert found.found.fix.proved


def test_friction_in_a_joint_that_the_other_model_closes_by_points_is_a_difference(four_bars):
    found = screwgauge.diagnose(*four_bars(d='damping="0.3"'))
    (said,) = found.differences
    assert said.what == "damping"
    assert (said.item_a, float(said.a), float(said.b)) == ("d", 0.3, 0.0)
    assert not found.same


def test_a_fix_of_a_model_that_is_cut_elsewhere_is_proved_in_its_file(tmp_path):
    write_models(load_mechanism("five-bar"), tmp_path)
    a, b = (tmp_path / f"five-bar{cut}.xml" for cut in ("", "-full"))
    text, heavier = b.read_text(encoding="utf-8"), tmp_path / "heavier.xml"
    heavier.write_text(text.replace('mass="0.5"', 'mass="0.65"', 1), encoding="utf-8")
    found = screwgauge.diagnose(a, heavier)
    assert found.found.fix.proved
    found.write_fix(tmp_path / "fixed.xml")
    assert 'mass="0.65"' not in (tmp_path / "fixed.xml").read_text(encoding="utf-8")
    assert screwgauge.diagnose(a, tmp_path / "fixed.xml").same


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
    code = (
        "import sys, numpy as np; from screwgauge.diagnosis.machine.alignment import assign; "
        "assign(np.array([[0.0, 1.0], [1.0, 0.0]])); print('scipy' in sys.modules); "
        "assign(np.array([[0.0, 1.0], [0.0, 3.0]])); print('scipy' in sys.modules)"
    )
    assert printed_by(code).split() == ["False", "True"]
