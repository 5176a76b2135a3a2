"""The ladder of states that do not quite close: what engines return for them, raw, and with the loops closed first."""

from __future__ import annotations

from collections.abc import Iterator

from screwgauge.scene.read import load_scene
from screwgauge.study.stress.case import Case, Finding, Rung
from screwgauge.study.stress.inverse.measure import still
from screwgauge.study.stress.inverse.states import ACCELERATIONS, POSES, RATES, SCENE, decades, samples


def closure_violation() -> Case:
    """Joint coordinates and rates off the manifold, as those of a file or of an integration are."""

    def rung(gap: float, quick: bool) -> Rung:
        def found() -> Iterator[Finding]:
            from screwgauge.study.stress.inverse.open_states import findings

            y, yd, ydd = (samples(array, quick) for array in (POSES, RATES, ACCELERATIONS))
            yield from findings(still(load_scene(SCENE), y, yd, ydd), gap)

        return Rung(gap, found)

    return Case(
        name="closure-violation",
        title="States that do not close",
        axis="gap [m], [m/s]",
        about="Coordinates and rates of the engines' open tree, with the cut joints apart by the gap and parting "
        "as fast. *projected*: the loops are closed by Newton's method first, as `screwgauge run` does, with the "
        "independent coordinates held. *raw*: the engine is called with the state as it is. The truth is that of the "
        "closed state. Raw, `actuator_force` is inverse dynamics of the open tree, projected on the actuators, which "
        "hardly amplifies the gap; `tree_force` is `mj_inverse` with its equality constraints on, whose stiff rows "
        "turn the gap into force; `forward_acceleration` is what the true actuator forces are said to cause. MuJoCo's "
        "projected accelerations are refined (d = 0.9999, 7 passes). Raw answers carry no warning.",
        drawn="forward_acceleration",
        low=1e-14,
        high=1e-2,
        full=decades(-12, -3),
        quick=decades(-13, -3, 2),
        rung=rung,
    )
