from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
from campaigns import ladders
from campaigns.compiled import near_home
from campaigns.volume import FORCES, measured, samples

from screwgauge.engines.screw.compiled import Solver
from screwgauge.engines.screw.traced import TracedWork
from screwgauge.models.catalog import four_bars
from screwgauge.scene.read import load_scene
from screwgauge.scene.scene import Scene

#: Samples of a chunk where only their number grows.
CHUNK = 1024
ROUNDS = 9


@dataclass(frozen=True, slots=True)
class Rung:
    """One size.

    Attributes:
        ladder: What grows.
        operations: Of the program; none where there is none, and the array solver answers.
        by_array: Samples that the array solver answered.
        setup_s: Processor time until the program is ready [s], compiled anew unless the cache has it.
        sample_us: Processor time of a sample [us].
    """

    ladder: str
    size: int
    operations: int
    by_array: int
    setup_s: float
    sample_us: float


#: Name -> description of each size, sizes, and samples of a motion: what closes loops step by step looks at whole
#: motions, what does not is called with what the cache holds.
MECHANISMS: Mapping[str, tuple[Callable[[int], str], tuple[int, ...], int]] = {
    "four-bars": (lambda n: four_bars(n, driven=True), (2, 4, 8, 16, 32, 40, 80, 160), 4096),
    "legs": (ladders.legs, (3, 6, 12, 24), 256),
    "joints": (ladders.arm, (3, 6, 12, 24, 48, 96), 256),
}
MOTIONS = (100, 1000, 10_000, 100_000, 1_000_000)


def climbed(ladder: str, sizes: Sequence[int], backend: str, rounds: int = ROUNDS) -> Iterator[Rung]:
    text, _, many = MECHANISMS[ladder]
    made, calls = {}, dict[str, tuple[Callable[[], object], int]]()
    for n in sizes:
        with TemporaryDirectory(prefix="screwgauge-") as folder:
            file = Path(folder) / "mechanism.toml"
            file.write_text(text(n), encoding="utf-8")
            scene = near_home(file, many)
            start = process_time()
            solver = Solver(scene, FORCES, backend, 1)
        spent, given = process_time() - start, scene.motion
        call = partial(solver, given.y, given.yd, given.ydd, out=solver.buffers(many))
        calls[str(n)] = call, many
        made[n] = _operations(solver), sum(call().by_array.values()), spent
    seconds = measured(calls, rounds)
    for n, numbers in made.items():
        yield Rung(ladder, n, *numbers, seconds[str(n)] * 1e6)


def _operations(solver: Solver) -> int:
    return len(solver.first.traced.program.code) if isinstance(solver.first, TracedWork) else 0


def lengthened(sizes: Sequence[int], backend: str, rounds: int = ROUNDS) -> Iterator[Rung]:
    scene = load_scene("3ups-upu-s")
    start = process_time()
    solver = Solver(scene, FORCES, backend, 1)
    spent = process_time() - start
    calls = {str(n): (_streamed(solver, scene, n), n) for n in sizes}
    for name, each in measured(calls, rounds).items():
        yield Rung("samples", int(name), _operations(solver), 0, spent, each * 1e6)


def _streamed(solver: Solver, scene: Scene, n: int) -> Callable[[], object]:
    chunk = samples(scene, min(n, CHUNK))

    def call() -> None:
        for _ in solver.stream(tuple(x[: n - i] for x in chunk) for i in range(0, n, CHUNK)):
            pass

    return call


def exponent(rungs: Sequence[Rung]) -> float:
    size = np.array([rung.size for rung in rungs], dtype=float)
    cost = np.array([rung.sample_us * (rung.size if rung.ladder == "samples" else 1.0) for rung in rungs])
    return float(np.polyfit(np.log(size), np.log(cost), 1)[0])


def rungs(count: int | None, backend: str = "llvm", rounds: int = ROUNDS) -> dict[str, list[Rung]]:
    ladders = {"samples": [*lengthened(MOTIONS[:count], backend, rounds)]}
    return ladders | {
        name: [*climbed(name, sizes[:count], backend, rounds)] for name, (_, sizes, _) in MECHANISMS.items()
    }
