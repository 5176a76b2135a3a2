"""Pinocchio and MuJoCo in a bench: closing their own loops, and their answers to true states over their settings."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from screwgauge.study.bench.contestant import FROM_Y, Contestant, count, of_each_quantity
from screwgauge.study.bench.questions import four_bar as on_four_bar
from screwgauge.study.bench.questions import motion, true_states
from screwgauge.study.method import Method
from screwgauge.study.posed import QUANTITIES

MU = (*(10.0**-k for k in range(2, 15)), 0.0)
ITERATIONS = (1, 2, 5, 20)
#: What diagrams name: iterations -> mu.
NAMED = {1: (MU[0], MU[4], MU[8], MU[12]), 2: (MU[2], MU[4], MU[6]), 5: MU[:2], 20: MU[:1]}
IMPEDANCE = (0.9, 0.95, 0.99, 0.995, 0.999, 0.9995, 0.9999)
STIFFEST = IMPEDANCE[-1]  # the largest that MuJoCo takes
TIME_CONSTANTS = (0.1, 0.02, 0.005, 0.002)
PASSES = (1, 2, 3, 4, 5, 7, 11, 15, 20)
PUSHED = partial(true_states, pushed=True)
ACCELERATION, FORCE = QUANTITIES[2:3], QUANTITIES[3:]


def _paths(engine: str, what: str) -> Iterator[Contestant]:
    """An engine as `screwgauge run` drives it: it closes its own loops."""
    path = partial(Contestant, engine, f"{engine}-path", "closes its own loops, minimal cut", Method(engine), motion)
    covers = f"{FROM_Y}: {what}, as far as needed; model loaded"
    return of_each_quantity(partial(path, covers=covers, label="closes its loops"))


def _projected(name: str, engine: str, function: str, setting: str, label: str) -> Contestant:
    """Inverse dynamics of the open tree on the true joint motion, then projection on the actuators."""
    covers = f"from given joint motion: {function} sample by sample, Jacobians, projection of all samples at once"
    given = partial(Contestant, method=Method(engine), question=true_states, given=True, series="given motion")
    return given(engine, name, setting, quantities=FORCE, covers=covers, label=label)


def pinocchio() -> Iterator[Contestant]:
    """From RNEA to actuator forces, and `constraintDynamics` over its proximal settings."""
    yield from _paths("pinocchio", "Newton on its own poses, rates, Jdot v, RNEA, projection")
    yield _projected("pinocchio-rnea", "pinocchio", "pin.rnea", "RNEA, then projection", "RNEA + projection")
    call, full = "pin.constraintDynamics sample by sample", "mu = 0 needs closure rows of full rank"
    covers = f"from given q, v and true forces: {call}; tree accelerations only"
    forward = partial(Contestant, "pinocchio-forward", quantities=ACCELERATION, covers=covers, given=True)
    for iterations in ITERATIONS:
        many = count(iterations, "iteration")
        for mu in MU:
            yield forward(
                "constraint-dynamics",
                f"mu = {mu:g}, {many}",
                _proximal(mu, iterations),
                PUSHED,
                series=many,
                parameter=("mu", mu) if mu else None,
                label=f"mu {mu:g}" if mu in NAMED[iterations] else "",
                hint="" if mu else full,
            )
    name, setting = "constraint-dynamics-default", "ProximalSettings(): mu = 0, 1 iteration"
    default = partial(forward, name, setting, _proximal(None, None), PUSHED)
    yield default(series="default", label="default", hint=full)
    hint = "the closure rows have rank 2 of 3, so that mu = 0 divides by zero; nothing is raised"
    covers = f"from given q, v and torque: {call}, on a planar four-bar"
    four_bar = partial(Contestant, "four-bar", "four-bar", drawn=False, hint=hint)
    for method, text in (
        (_proximal(None, None), "default: mu = 0, 1 iteration"),
        (_proximal(1e-10, 1), "mu = 1e-10, 1 iteration"),
        (_proximal(1e-10, 2), "mu = 1e-10, 2 iterations"),
    ):
        yield four_bar(f"planar four-bar closed by a 3D contact, {text}", method, on_four_bar, ACCELERATION, covers)


def _proximal(mu: float | None, iterations: int | None) -> Method:
    """None, None: the settings that `pin.ProximalSettings()` has."""
    return Method("pinocchio", {"mu": mu, "iterations": iterations})


def mujoco() -> Iterator[Contestant]:
    """`mj_inverse` projected and read naively, `mj_forward` over its softness, proximal refinement."""
    yield from _paths("mujoco", "Newton on its own poses, rates, Jdot v, mj_inverse, projection")
    what = "mj_inverse, then projection", "mj_inverse + projection"
    yield _projected("mj-inverse-projected", "mujoco", "mj_inverse", *what)
    yield Contestant(
        "mujoco-naive",
        "mj-inverse-naive",
        "qfrc_inverse of the actuated joints read as actuator forces",
        Method("mujoco", {"naive": True}),
        true_states,
        FORCE,
        "from given joint motion: mj_inverse sample by sample, equality constraints on, loads taken off",
        label="mj_inverse, read naively",
        given=True,
    )
    covers = "from given q, v and true forces: mj_forward sample by sample{}; tree accelerations only"
    forward = partial(Contestant, question=PUSHED, quantities=ACCELERATION, covers=covers.format(""), given=True)
    soft = partial(forward, "mujoco-forward", "mj-forward")
    yield soft("all settings default", Method("mujoco"), label="default", series="default")
    for d in IMPEDANCE:
        yield soft(
            f"solimp d = {d:g}, solref default",
            Method("mujoco", {"solimp": d}),
            parameter=("(1 - d) / d", (1 - d) / d),
            label=f"d {d:g}" if d in (0.9, 0.99, STIFFEST) else "",
            series="solimp",
        )
    for constant in TIME_CONSTANTS:  # acts on closure residuals, and there are none
        setting = f"solimp d = {STIFFEST:g}, solref time constant = {constant:g} s"
        method = Method("mujoco", {"solimp": STIFFEST, "solref": constant})
        yield forward("mujoco-forward", "mj-forward-solref", setting, method, series="solref", drawn=False)
    refined = partial(forward, "mujoco-refinement", "mj-refinement")
    covers = covers.format(", then mj_forwardSkip for each pass")
    for d in (0.9, STIFFEST):
        for passes in PASSES:
            many = count(passes, "pass")
            yield refined(
                f"solimp d = {d:g}, {many}",
                Method("mujoco", {"solimp": d, "passes": passes}),
                covers=covers,
                series=f"d = {d:g}",
                parameter=("passes", float(passes)),
                label=many,
            )
