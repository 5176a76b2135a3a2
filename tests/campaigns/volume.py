"""What compiled programs cost a sample, next to bare inverse dynamics of Pinocchio and MuJoCo on the same tree."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import thread_time_ns

import numpy as np
import pinocchio as pin

from screwgauge.api import compile
from screwgauge.engines.mujoco.tree import MujocoTree
from screwgauge.engines.pinocchio.tree import PinocchioTree
from screwgauge.models.catalog import load_mechanism
from screwgauge.models.files.loops import loops_of
from screwgauge.models.generate import write_models
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.bench.timing import FULL, measure

FORCES = ("actuator_force",)
#: Samples of a call, so that buffers stay in the cache: of all quantities, and of forces alone; of `rnea`.
SAMPLES, BARE = {"llvm": (384, 1024), "numpy": (6144, 6144)}, 256
#: Samples of a measurement: as many of every contestant, in calls one after the other.
SHARE = 6144
ROUNDS = 15
#: Name -> what is called, and its samples.
Calls = Mapping[str, tuple[Callable[[], object], int]]


def bare() -> dict[str, Callable[[], object]]:
    mechanism = load_mechanism("3ups-upu-s")
    loops = loops_of(mechanism, "minimal")
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(mechanism, Path(folder))
        pinocchio = PinocchioTree(Path(folder) / f"{mechanism.name}.urdf", loops)
        mujoco = MujocoTree(Path(folder) / f"{mechanism.name}.xml", loops)
    states = np.random.default_rng(0).normal(size=(3, BARE, len(loops.tree)))
    rows, columns = [*zip(*states, strict=True)], [np.asfortranarray(each.T) for each in states]
    pool, tau = pin.ModelPool(pinocchio.model, 1), np.empty_like(columns[0])

    def rnea() -> None:
        for row in rows:
            pin.rnea(pinocchio.model, pinocchio.data, *row)

    together = partial(pin.rneaInParallel, 1, pool, *columns, tau)
    return {"rnea": rnea, "rneaInParallel, 1 thread": together, "mj_inverse": partial(mujoco.tree_force, *states)}


def samples(scene: Scene, n: int) -> tuple[Array, ...]:
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], n)).motion
    return motion.y.copy(), motion.yd.copy(), motion.ydd.copy()


def contestants(backends: Sequence[str]) -> Calls:
    scene = load_scene("3ups-upu-s")
    calls: dict[str, tuple[Callable[[], object], int]] = {name: (call, BARE) for name, call in bare().items()}
    for backend in backends:
        for what, wanted, n in zip(("all", "forces"), (None, FORCES), SAMPLES[backend], strict=True):
            solver, given = compile(scene, wanted, backend=backend), samples(scene, n)
            for estimates in ((), ("estimates",)):
                call = partial(solver, *given, out=solver.buffers(n), estimates=bool(estimates))
                calls[", ".join((f"{backend} {what}", *estimates, *solver.notes, *call().by_array))] = call, n
    return calls


def measured(calls: Calls, rounds: int = ROUNDS) -> dict[str, float]:
    spent: dict[str, list[float]] = {name: [] for name in calls}
    counts = {name: -(-SHARE // n) for name, (_, n) in calls.items()}

    def repeated(name: str) -> None:
        for _ in range(counts[name]):
            calls[name][0]()

    shares = {name: partial(repeated, name) for name in calls}
    for share in shares.values():
        share()
    plan = replace(FULL, rounds=rounds, clock=thread_time_ns)
    measure(shares, plan, lambda name, s: spent[name].append(s), spent, dict.fromkeys(calls, 1e-3))
    return {name: median(times) / counts[name] / calls[name][1] for name, times in spent.items()}
