"""All kinds of change, by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from campaigns import mutations, placements
from campaigns.mutant import CannotError, Expected, Random
from campaigns.mutations import Mutation, passive

from screwgauge.diagnosis.files.xml_text import XmlText

_SINGLE: tuple[Mutation, ...] = (
    *(mutations.mass_factor, mutations.mass_in_grams, mutations.masses_swapped, mutations.all_masses_factor),
    *(mutations.com_shift, mutations.com_in_millimetres, mutations.com_mirrored, mutations.com_lost),
    *(mutations.moment_factor, mutations.tensor_factor, mutations.product_shift, mutations.products_negated),
    *(mutations.products_in_other_order, mutations.axes_permuted, mutations.about_the_origin),
    *(mutations.orientation_lost, mutations.orientation_transposed, mutations.tensor_in_gram_millimetres),
    *(placements.axis_reversed, placements.axis_tilted, placements.zero_offset, placements.limit_changed),
    *(placements.placement_shift, placements.placement_turn, placements.placement_turn_lost),
    *(placements.placement_in_millimetres, placements.gravity_value, placements.gravity_direction),
    *(placements.compensation, placements.gear_changed, placements.joint_fixed, placements.branch_missing),
    *(placements.digits, placements.anchor_moved, placements.coupling_changed),
)
_PASSIVE = {
    "armature": ("", "armature"),
    "damping": ("damping", "damping"),
    "friction": ("friction", "frictionloss"),
    "stiffness": ("", "stiffness"),
    "rest": ("", "springref"),
}
_FIRST = (mutations.mass_factor, mutations.com_shift, placements.axis_tilted)
_SECOND = (mutations.moment_factor, placements.placement_shift, passive("damping", *_PASSIVE["damping"]))
#: Makes a changed text of a text, and says what a diagnosis has to say of it; raises `CannotError` where the text has
#: no place for that kind of change.
Change = Callable[[str, Random, float], tuple[str, list[Expected]]]


def _one(mutation: Mutation, text: str, rng: Random, size: float) -> tuple[str, list[Expected]]:
    xml = XmlText(text, "the model")
    expected = mutation(xml, rng, size)
    return xml.text(), expected


def _two(text: str, rng: Random, size: float) -> tuple[str, list[Expected]]:
    """Two changes of different parts, of about the same size."""
    text, first = _one(_FIRST[rng.integers(len(_FIRST))], text, rng, size)
    text, second = _one(_SECOND[rng.integers(len(_SECOND))], text, rng, size)
    if first[0].item == second[0].item:
        raise CannotError("both are of one part")
    return text, [*first, *second]


KINDS: dict[str, Change] = {
    **{mutation.__name__: partial(_one, mutation) for mutation in _SINGLE},
    **{what: partial(_one, passive(what, *names)) for what, names in _PASSIVE.items()},
    "two_at_once": _two,
}
