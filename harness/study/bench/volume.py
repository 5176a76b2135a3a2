"""What compiled programs cost a sample, beside bare calls of Pinocchio's `rnea` on the same tree.

``python -m screwgauge.study.bench.volume`` measures all in turn, and prints medians and ratios.
"""

from __future__ import annotations

import resource
from collections.abc import Callable, Iterator, Mapping, Sequence
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

FORCES = ("actuator_force",)
#: Samples of a call, so that buffers stay in the cache: of all quantities, and of forces alone.
SAMPLES = {"llvm": (256, 1024), "numpy": (4096, 4096)}
ROUNDS, MILLION = 15, 2**20


def bare(n: int) -> Callable[[], None]:
    """Calls of `rnea` on the open tree of the paper's mechanism, at so many states."""
    from screwgauge.engines.pinocchio.tree import PinocchioTree
    from screwgauge.models.loops import loops_of
    from screwgauge.models.urdf import write_urdf

    mechanism = load_mechanism("3ups-upu-s")
    with TemporaryDirectory(prefix="screwgauge-") as folder:
        urdf = Path(folder) / "tree.urdf"
        urdf.write_text(write_urdf(mechanism, "minimal"), encoding="utf-8")
        tree = PinocchioTree(urdf, loops_of(mechanism, "minimal"))
    return tree.bare(*np.random.default_rng(0).normal(size=(3, n, len(tree.coordinates))))


def samples(scene: Scene, n: int) -> tuple[Array, ...]:
    """Samples of a scene's motion. Shape (n, k) each."""
    motion = scene.at(np.linspace(scene.t[0], scene.t[-1], n)).motion
    return motion.y.copy(), motion.yd.copy(), motion.ydd.copy()


def contestants(backends: Sequence[str]) -> dict[str, tuple[Callable[[], object], int]]:
    """Name -> what is called, and its samples: whole calls with buffers that are used again."""
    scene = load_scene("3ups-upu-s")
    calls: dict[str, tuple[Callable[[], object], int]] = {"rnea": (bare(256), 256)}
    for backend in backends:
        for what, wanted, n in zip(("all", "forces"), (None, FORCES), SAMPLES[backend], strict=True):
            solver, given = compile(scene, wanted, backend=backend), samples(scene, n)
            for estimates in (False, True):
                calls[f"{backend} {what}{', estimates' * estimates}"] = _call(solver, given, estimates=estimates), n
    return calls


def _call(solver: Callable[..., object], given: tuple[Array, ...], *, estimates: bool) -> Callable[[], object]:
    out = solver.buffers(len(given[0]))  # type: ignore[attr-defined]
    return lambda: solver(*given, out=out, estimates=estimates)


def measured(calls: Mapping[str, tuple[Callable[[], object], int]], rounds: int = ROUNDS) -> dict[str, float]:
    """Seconds of the processor a sample of each, the median of interleaved rounds: no other process counts."""
    spent: dict[str, list[float]] = {name: [] for name in calls}
    for call, _ in calls.values():
        call()
    protocol = Protocol(rounds, float("inf"), thread_time_ns)
    only = {name: call for name, (call, _) in calls.items()}
    measure(only, protocol, lambda name, s: spent[name].append(s), spent, dict.fromkeys(calls, 1e-3))
    return {name: median(times) / calls[name][1] for name, times in spent.items()}


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
    seconds, peak = million()
    print(f"{MILLION} samples, forces only, streamed: {seconds:.2f} s, peak {peak:.0f} MB")
    found = measured(contestants(("llvm", "numpy")))
    for name, each in found.items():
        print(f"{name:25} {each * 1e6:8.3f} us a sample, {found['rnea'] / each:6.2f} times as fast as rnea")


if __name__ == "__main__":
    main()
