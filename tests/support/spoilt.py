"""Tables with known faults, made by code from the numbers of an engine other than the one that reviews them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
from scipy.signal import butter, filtfilt

from screwgauge import Recorded, Scene, load_scene
from screwgauge.study.solving import solve

DIGITS = 8  # that a table prints
NOISE = 0.3  # [N]
SPRING = {"coordinate": "left", "stiffness": 3.0, "rest": 0.2}


@dataclass(frozen=True, slots=True)
class Spoilt:
    """A table with faults.

    Attributes:
        scene: Built-in name.
        quantity: What the table gives.
        spoil: Takes the scene and ``right(scene)``, the right numbers; returns those of the table, index t [s].
        faults: (kind, of what) -> its size, and the columns that have it; all columns that it can change by default.
        changes: What the scene has beyond the built-in one, see `Scene.under`.
    """

    scene: str
    quantity: str
    spoil: Callable[[Scene, Callable[[Scene], pd.DataFrame]], pd.DataFrame]
    faults: Mapping[tuple[str, str], tuple[float, tuple[str, ...]]]
    changes: Mapping[str, object] = field(default_factory=dict)

    def make(self) -> tuple[Scene, Recorded]:
        scene = scene_of(self.scene, **self.changes)
        return scene, printed(self.spoil(scene, lambda some: right(some, self.quantity)), self.quantity)


def scene_of(name: str, n: int = 201, **changes: object) -> Scene:
    scene = load_scene(name)
    scene = scene.at(np.linspace(0.0, scene.t[-1], n))
    return scene.under(**changes) if changes else scene


def right(scene: Scene, quantity: str) -> pd.DataFrame:
    answers, _ = solve(replace(scene, models={}), ["pinocchio"], [quantity])
    values = answers["pinocchio"].values[quantity]
    return pd.DataFrame(values.array, index=scene.t, columns=list(values.components))


def printed(table: pd.DataFrame, quantity: str) -> Recorded:
    text = table.map(lambda value: float(f"{value:.{DIGITS}g}"))
    return Recorded(table.index.to_numpy(), {f"{quantity}/{name}": text[name].to_numpy() for name in text})


def times(**factors: float) -> Callable[[Scene, Callable[[Scene], pd.DataFrame]], pd.DataFrame]:
    """Multiplies some columns."""
    return lambda scene, right: right(scene).assign(**{name: f * right(scene)[name] for name, f in factors.items()})


def late(scene: Scene, right: Callable[[Scene], pd.DataFrame], samples: float) -> pd.DataFrame:
    step = scene.t[1] - scene.t[0]
    return right(scene.at(scene.t - samples * step)).set_index(scene.t)


def _held(table: pd.DataFrame, samples: float) -> pd.DataFrame:
    t = table.index.to_numpy()
    return table.apply(lambda column: np.interp(t - samples * (t[1] - t[0]), t, column))


def noise(n: int, seed: int) -> np.ndarray:
    return NOISE * np.random.default_rng(seed).normal(size=n)


def _filtered(scene: Scene, right: Callable[[Scene], pd.DataFrame]) -> pd.DataFrame:
    return right(scene).apply(lambda column: filtfilt(*butter(2, 0.08), column))


def _swapped(scene: Scene, right: Callable[[Scene], pd.DataFrame]) -> pd.DataFrame:
    table = late(scene, right, 0.4)
    return table.assign(leg1=table["leg3"], leg3=table["leg1"], leg4=-table["leg4"])


def _of_some(scene: Scene, right: Callable[[Scene], pd.DataFrame]) -> pd.DataFrame:
    table = right(scene)[["joint2", "joint4"]]
    return table.assign(
        joint2=-table["joint2"] + noise(len(table), 3), joint4=table["joint4"] + 2.5 + noise(len(table), 4)
    )


def _side(scene: Scene, right: Callable[[Scene], pd.DataFrame]) -> pd.DataFrame:
    table = right(scene)
    return table.assign(**{name: -table[name] for name in table if name.startswith("crank.")})


#: Chosen before the first of them was ever reviewed.
SPOILT = {
    "degrees": Spoilt(
        "five-bar",
        "joint_position",
        lambda scene, right: np.rad2deg(right(scene)),
        {("unit", "degrees"): (180.0 / np.pi, ())},
    ),
    "N mm": Spoilt("delta", "actuator_force", lambda scene, right: 1e3 * right(scene), {("unit", "N mm"): (1e3, ())}),
    "sign": Spoilt("3ups-upu-s", "actuator_force", times(leg2=-1.0), {("sign", ""): (-1.0, ("leg2",))}),
    "permutation": Spoilt(
        "stewart",
        "actuator_force",
        lambda scene, right: right(scene).rename(columns={"leg2": "leg5", "leg5": "leg2"}),
        {("permutation", "leg5"): (1.0, ("leg2",)), ("permutation", "leg2"): (1.0, ("leg5",))},
    ),
    "shift": Spoilt(
        "slider-crank",
        "actuator_force",
        lambda scene, right: late(scene, right, 0.37),
        {("shift", ""): (0.37 * 2.0 / 200, ())},
    ),
    "shift between samples": Spoilt(
        "slider-crank",
        "actuator_force",
        lambda scene, right: -_held(right(scene), 3.37),
        {("shift", ""): (3.37 * 2.0 / 200, ()), ("held", ""): (1.0, ()), ("sign", ""): (-1.0, ())},
    ),
    "offset": Spoilt(
        "arm7",
        "actuator_force",
        lambda scene, right: right(scene).assign(joint4=right(scene)["joint4"] + 0.8),
        {("offset", ""): (0.8, ("joint4",))},
    ),
    "gravity": Spoilt(
        "3ups-upu-s",
        "actuator_force",
        lambda scene, right: right(scene.under(gravity=[0, 0, 0])),
        {("missing", "gravity"): (1.0, ())},
    ),
    "load": Spoilt(
        "slider-crank",
        "actuator_force",
        lambda scene, right: right(scene.under(loads=[])),
        {("missing", "load on piston"): (1.0, ())},
    ),
    "spring": Spoilt(
        "five-bar",
        "actuator_force",
        lambda scene, right: right(scene.under(springs=[])),
        {("missing", "spring at left"): (1.0, ())},
        {"springs": [SPRING]},
    ),
    "other side": Spoilt("slider-crank", "reaction", _side, {("side", "crank"): (-1.0, ())}),
    "filter": Spoilt(
        "delta",
        "actuator_force",
        _filtered,
        {("filter", "Butterworth, order 2, forwards and backwards"): (0.08 * 50.0, ())},
    ),
    "noise": Spoilt(
        "stewart",
        "actuator_force",
        lambda scene, right: right(scene).assign(leg6=right(scene)["leg6"] + noise(201, 2)),
        {("noise", ""): (NOISE, ("leg6",))},
    ),
    "swap, sign and shift": Spoilt(
        "3ups-upu-s",
        "actuator_force",
        _swapped,
        {
            ("permutation", "leg3"): (1.0, ("leg1",)),
            ("permutation", "leg1"): (1.0, ("leg3",)),
            ("sign", ""): (-1.0, ("leg4",)),
            ("shift", ""): (0.4 * 10.0 / 200, ()),
        },
    ),
    "no gravity, in N mm": Spoilt(
        "delta",
        "actuator_force",
        lambda scene, right: 1e3 * right(scene.under(gravity=[0, 0, 0])),
        {("missing", "gravity"): (1.0, ()), ("unit", "N mm"): (1e3, ())},
    ),
    "two of seven, sign, offset and noise": Spoilt(
        "arm7",
        "actuator_force",
        _of_some,
        {("sign", ""): (-1.0, ("joint2",)), ("offset", ""): (2.5, ("joint4",)), ("noise", ""): (NOISE, ())},
    ),
}
