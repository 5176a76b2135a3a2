"""Our own solver in a bench: its parts and precisions, what shortcuts cost, and the paper's scheme."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from screwgauge.study.bench.contestant import FROM_Y, NOTHING, Contestant, count, of_each_quantity
from screwgauge.study.bench.questions import differenced, faster, motion, one_by_one, stepped
from screwgauge.study.method import Method
from screwgauge.study.posed import QUANTITIES

#: Steps as parts of the motion's duration, on a scene of 10 s: differences 1e-3 s to 5e-2 s, Euler 1e-1 s to 1e-4 s,
#: Runge and Kutta 2e-1 s to 1e-2 s.
DIFFERENCES = (1e-4, 2e-4, 5e-4, 1e-3, 2.5e-3, 5e-3)
EULER = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 1e-5)
RK4 = (2e-2, 1e-2, 5e-3, 2e-3, 1e-3)
SPEEDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
ROUNDING = 60  # Newton steps after which nothing but rounding is left
#: The twist of the paper's scheme, in words, and its line.
TWISTS = {
    "printed": ("eq. (60) as printed", "eq. 60"),
    "literal": ("eqs. (22)-(23) and (60) as printed", "eqs 22, 23, 60"),
    "right": ("right twist", ""),
}


def _variant(name: str, **settings: Any) -> Method:
    return Method("screw", {"variant": {"name": name, **settings}})


def solver(quick: bool) -> Iterator[Contestant]:
    """Our own solver: its parts, its precisions, and per sample against whole trajectory."""
    covers = "a Python loop over the samples that does nothing"
    yield Contestant("floor", "floor", "empty loop", _variant("nothing"), motion, (NOTHING,), covers, drawn=False)
    closed = partial(Contestant, "closed-form", "closed-form", "whole trajectory, no Newton step", question=motion)
    covers = f"{FROM_Y}: closed form, then all samples at once"
    yield from of_each_quantity(partial(closed, _variant("closed form"), covers=covers, label="closed form"))
    yield from of_each_quantity(*map(_newton, (0, 1, 2, ROUNDING)))
    float32 = partial(Contestant, "float32", "float32", "whole trajectory, all arrays float32", question=motion)
    covers = f"{FROM_Y}: closed form (Newton where that leaves gaps), then all samples at once"
    single = _variant("closed form", dtype="float32", mended=True)
    yield from of_each_quantity(partial(float32, single, covers=covers, label="float32"))
    covers = f"{FROM_Y}: the engine screw, model loaded"
    screw = partial(Contestant, "screw", "screw-trajectory", method=Method("screw"), covers=covers)
    compared = partial(screw, "whole trajectory, the compared samples", question=motion, label="trajectory")
    everywhere = partial(motion, whole=True)
    whole = partial(screw, "whole trajectory, all samples of the scene", question=everywhere, label="all samples")
    yield from of_each_quantity(compared, *(() if quick else (whole,)))
    covers = f"{FROM_Y}: the engine screw, one call a sample, model loaded"
    screw = partial(Contestant, "screw", "screw-per-sample", "one sample at a time", Method("screw"), one_by_one)
    yield from of_each_quantity(partial(screw, covers=covers, label="per sample"))


def _newton(steps: int) -> Callable[..., Contestant]:
    many, label = count(steps, "Newton step"), count(steps, "step")
    if steps == ROUNDING:
        many, label = "Newton to rounding", "converged"
    covers, setting = f"{FROM_Y}: path from home, Newton, then all samples at once", f"{many} after the prediction"
    newton = partial(Contestant, "newton", "newton", f"whole trajectory, {setting}", question=motion, covers=covers)
    return partial(newton, _variant("newton", steps=steps), label=label)


def shortcuts(quick: bool) -> Iterator[Contestant]:
    """What shortcuts cost: differentiating positions numerically, and forgetting Jdot v."""
    differences = partial(Contestant, "finite-differences", method=_variant("differences"))
    parts = DIFFERENCES[1:] if quick else DIFFERENCES
    for ends, quantity in ((False, QUANTITIES[1]), (False, QUANTITIES[2]), (True, QUANTITIES[2])):
        times, where = "once" if quantity == QUANTITIES[1] else "twice", "the two samples at each end"
        for part in parts:
            yield differences(
                "differences-ends" if ends else "differences",
                f"step = {part:g} of the duration, {where if ends else 'interior'}",
                question=partial(differenced, part=part, ends=ends),
                quantities=(quantity,),
                covers=f"from y: positions of every step of the trajectory, np.gradient {times}",
                series="ends" if ends else "interior",
                parameter=("step / duration", part),
                label=f"{part:g} T",
                drawn=not ends,
            )
    for speed in SPEEDS:
        yield Contestant(
            "missing-jdotv",
            "missing-jdotv",
            f"speed x {speed:g}, error against the largest acceleration at speed x 1",
            _variant("without drift"),
            partial(faster, speed=speed),
            QUANTITIES[2:3],
            f"{FROM_Y}: positions, rates, A a = [0; ydd]; all samples at once",
            parameter=("speed", speed),
            label="Jdot v left out",
            drawn=speed == 1.0,
        )


def paper(quick: bool) -> Iterator[Contestant]:
    """The paper's own scheme with the twist of eq. (60), without and with eqs. (22)-(23), and with the right one."""
    covers = "from the first pose and the twist of the platform: every step of the trajectory, then eq. (44)"
    scheme = partial(Contestant, quantities=QUANTITIES[:3], covers=covers)
    for twist, name, parts in (
        ("printed", "Euler", EULER[:-1]),
        ("literal", "Euler", EULER[:-1]),
        ("right", "Euler", EULER),
        ("right", "RK4", RK4),
    ):
        family, (words, series) = f"paper-{'corrected' if twist == 'right' else 'printed'}", TWISTS[twist]
        for part in parts[:5] if quick else parts:
            yield scheme(
                family,
                family,
                f"{words}, {name}, step = {part:g} of the duration",
                _variant("paper", twist=twist, method=name.lower()),
                partial(stepped, part=part, halves=name == "RK4"),
                series=series or name,
                parameter=("step / duration", part),
                label=f"{part:g} T",
            )
