import pytest

from support.data import data
from support.machines import (
    Believed,
    align,
    close_loops,
    coordinate_placement,
    draw,
    load_side,
    machine_of,
    misfits,
    rehome,
    tree_of,
)
from support.mechanism import load_mechanism
from support.models import write_models
from support.tolerances import ROUNDING

#: A planar four-bar of two chains: where it is cut, and which way its joints lead.
FROM_CRANK = data("from-crank.xml")
FROM_ROCKER = data("from-rocker.xml")
PINS = '<connect body1="{0}" anchor="0 -0.1 0"/><connect body1="{0}" anchor="0 0.1 0"/>'


def elsewhere(reading):
    tree = tree_of(reading)
    for q in close_loops(tree, draw(reading, 8))[0].q:
        values = {name: q[at] if at.stop - at.start > 1 else q[at][0] for name, at in tree.places.items()}
        yield rehome(reading, values)[0]


def farthest(one, other):
    a, b = machine_of(one), machine_of(other)
    same = {name: name for name in one.joints if name in other.joints}
    found = align(a, b, same, {name: name for name in one.bodies}, Believed.SIMILAR)
    pairs = [
        (ours, theirs)
        for ours, theirs in found.links
        if ours.articulated and theirs.articulated and {*ours.joints} == {*theirs.joints} <= {*same}
        if found.bodies[ours.far] == theirs.far
    ]
    assert any(element.turned for links in pairs for link in links for element in link.elements)
    placements = [coordinate_placement(a, b, links, found.placed[links[0].near]) for links in pairs]
    return max(misfits(a, b, (one.far, other.far), T).max() for (one, other), T in zip(pairs, placements, strict=True))


@pytest.mark.parametrize("kind", ["urdf", "xml"])
@pytest.mark.parametrize("name", ["3ups-upu-s", "bennett"])
def test_links_that_are_passed_against_their_joints_are_laid_onto_their_partners(name, kind, tmp_path):
    write_models(load_mechanism(name), tmp_path)
    reading = load_side(tmp_path / f"{name}.{kind}").reading
    assert max(farthest(reading, other) for other in elsewhere(reading)) < ROUNDING


def test_a_joint_that_leads_the_other_way_in_one_model_is_laid_onto_its_partner(write):
    sides = []
    for name, (bodies, last) in {"a": (FROM_CRANK, "rocker"), "b": (FROM_ROCKER, "crank")}.items():
        text = f"<mujoco><worldbody>{bodies}</worldbody><equality>{PINS.format(last)}</equality></mujoco>"
        sides.append(load_side(write(f"{name}.xml", text)).reading)
    assert max(farthest(sides[0], other) for other in elsewhere(sides[1])) < ROUNDING
