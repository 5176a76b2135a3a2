"""What compiled programs cost a sample, beside bare inverse dynamics of Pinocchio and MuJoCo on the same tree.

``python -m campaigns.volume`` measures all in turn, and prints medians and ratios.
"""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import perf_counter, thread_time_ns

import numpy as np

from screwgauge.engines.screw.compiled import compile
from screwgauge.models.catalog import load_mechanism
from screwgauge.reference.rotations import Array
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene
from screwgauge.study.bench.timing import Protocol, measure
from screwgauge.threads import alone

FORCES = ("actuator_force",)
#: Samples of a call, so that buffers stay in the cache: of all quantities, and of forces alone.
SAMPLES = {"llvm": (384, 1024), "numpy": (6144, 6144)}
#: Samples of a measurement: as many of every contestant, in calls one after the other.
SHARE = 6144
ROUNDS, MILLION = 15, 2**20
Calls = Mapping[str, tuple[Callable[[], object], int]]
"""Name -> what is called, and its samples."""


def bare(n: int) -> dict[str, Callable[[], None]]:
    """Inverse dynamics on the open tree of the paper's mechanism, at so many states."""
    from screwgauge.engines.mujoco.tree import MujocoTree
    from screwgauge.engines.pinocchio.tree import PinocchioTree
    from screwgauge.models.generate import write_models
    from screwgauge.models.loops import loops_of

    mechanism = load_mechanism("3ups-upu-s")
    loops = loops_of(mechanism, "minimal")
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        write_models(mechanism, Path(folder))
        pinocchio = PinocchioTree(Path(folder) / f"{mechanism.name}.urdf", loops)
        mujoco = MujocoTree(Path(folder) / f"{mechanism.name}.xml", loops)
    states = np.random.default_rng(0).normal(size=(3, n, len(loops.tree)))
    return pinocchio.bare(*states) | mujoco.bare(*states)


def samples(scene: Scene, n: int) -> tuple[Array, ...]:
    """Samples of a scene's motion. Shape (n, k) each."""
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], n)).motion
    return motion.y.copy(), motion.yd.copy(), motion.ydd.copy()


def contestants(backends: Sequence[str]) -> Calls:
    """Whole calls with buffers that are used again; a name says if something else had to run."""
    scene = load_scene("3ups-upu-s")
    calls: dict[str, tuple[Callable[[], object], int]] = {name: (call, 256) for name, call in bare(256).items()}
    for backend in backends:
        for what, wanted, n in zip(("all", "forces"), (None, FORCES), SAMPLES[backend], strict=True):
            solver, given = compile(scene, wanted, backend=backend), samples(scene, n)
            for estimates in ((), ("estimates",)):
                call = partial(solver, *given, out=solver.buffers(n), estimates=bool(estimates))
                calls[", ".join((f"{backend} {what}", *estimates, *solver.notes, *call().by_array))] = call, n
    return calls


def measured(calls: Calls, rounds: int = ROUNDS, clock: Callable[[], int] = thread_time_ns) -> dict[str, float]:
    """Seconds of the processor a sample of each, the median of interleaved rounds: no other process counts."""
    spent: dict[str, list[float]] = {name: [] for name in calls}
    counts = {name: -(-SHARE // n) for name, (_, n) in calls.items()}

    def repeated(name: str) -> None:
        for _ in range(counts[name]):
            calls[name][0]()

    shares = {name: partial(repeated, name) for name in calls}
    for share in shares.values():
        share()
    protocol = Protocol(rounds, float("inf"), clock)
    measure(shares, protocol, lambda name, s: spent[name].append(s), spent, dict.fromkeys(calls, 1e-3))
    return {name: median(times) / counts[name] / calls[name][1] for name, times in spent.items()}


def million(n: int = 1024) -> tuple[float, float]:
    """Seconds of a million samples, forces only, streamed; and the peak of this process's memory [MB]."""
    scene = load_scene("3ups-upu-s")
    solver, given = compile(scene, FORCES), samples(scene, n)

    def chunks() -> Iterator[tuple[Array, ...]]:
        for _ in range(MILLION // n):
            yield given

    start, total = perf_counter(), 0.0
    for answer in solver.stream(chunks()):
        total += float(answer["actuator_force"][0, 0])
    return perf_counter() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    """Prints what was measured."""
    alone()
    seconds, peak = million()
    print(f"{MILLION} samples, forces only, streamed: {seconds:.2f} s, peak {peak:.0f} MB")
    found = measured(contestants(("llvm", "numpy")))
    for name, each in found.items():
        print(f"{name:24} {each * 1e6:8.3f} us a sample, {found['rnea'] / each:6.2f} times as fast as rnea")


if __name__ == "__main__":
    main()
