"""``screwgauge.compile(scene, parameters=[...])``: one program for all variants of a machine.

Variants occupy the lanes of a register, and samples are processed one after the other, so the parameters of variants
are stored only once. If only mass properties change, poses stay the same, see `Matter`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from screwgauge.engines.screw.buffers import check_finite
from screwgauge.engines.screw.inverse import Work
from screwgauge.engines.screw.matter import Matter
from screwgauge.engines.screw.nominal import NominalMachine, Slopes, stack_inputs
from screwgauge.engines.screw.programs import runner
from screwgauge.problem import GivenMotion
from screwgauge.reference.errors import DescriptionError, ScrewgaugeError, check_choice
from screwgauge.reference.graph import layout
from screwgauge.reference.parameters import inertial, numbers, resolve
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import CHECKS, ClosedSamples, Symbols, gradient
from screwgauge.scene.scene import Scene

#: Largest number of variants processed at a time, and largest number of their values.
LANES, HELD = 256, 4_000_000
#: Steps of Newton's method from a prediction: two, or three if more than this fraction of the variants needs three.
STEPS, MANY = (2, 3), 0.2
#: Number of times that a program continues from its last poses.
AGAIN = 4
#: Step above which the next step must be at most a quarter as large; below it, both steps are at rounding level.
TESTED, QUARTER = 1e-7, 0.25
#: Next step below which a pose counts as closed, and largest residual allowed in any row [rad or mechanism lengths].
CLOSED, OPEN = 1e-13, 1e-11
#: Why a variant has no values.
ROWS_OPEN, NOT_CLOSED, IMPOSSIBLE = "rows open", "does not close", "impossible body"
REASON = f"<U{max(map(len, (ROWS_OPEN, NOT_CLOSED, IMPOSSIBLE)))}"
#: Statistics over the samples by name, from values of shape (n, m, V).
STATISTICS: Mapping[str, Callable[[Array], Array]] = {
    "peak": lambda x: np.abs(x).max(axis=0),
    "rms": lambda x: np.sqrt(np.mean(x * x, axis=0)),
    "mean": lambda x: np.mean(x, axis=0),
    "min": lambda x: x.min(axis=0),
    "max": lambda x: x.max(axis=0),
}


@dataclass(frozen=True, slots=True, eq=False)
class VariantSolution:
    """Results for all variants.

    Attributes:
        values: Quantity -> values, NaN for variants without values. Shape (V, n, n_component); statistics have shape
            (V, n_component).
        why: Reason why each variant has no values, or an empty string. Shape (V,).
    """

    values: Mapping[str, Array]
    why: NDArray[np.str_]

    def __getitem__(self, quantity: str) -> Array:
        return self.values[quantity]


class _Worst:
    """Squares of each variant's largest checks over the samples. Shape (V,) each."""

    def __init__(self, count: int) -> None:
        self.following, self.ratio, self.open = np.zeros((3, count))

    def meet(self, first: Array, second: Array, step: Array, following: Array, rows: Array) -> None:
        """Update the maxima with the checks of a sample; NaN persists."""
        np.maximum(self.following, following, out=self.following)
        np.maximum(self.open, rows, out=self.open)
        for before, after in ((first, second), (step, following)):
            np.maximum(self.ratio, after / np.where(before > TESTED**2, before, np.inf), out=self.ratio)

    @property
    def contracts(self) -> NDArray[np.bool_]:
        """True where each Newton step is much smaller than the one before: poses stay in their assembly mode."""
        return self.ratio <= QUARTER**2

    @property
    def closed(self) -> NDArray[np.bool_]:
        return (self.following <= CLOSED**2) & self.contracts & (self.open <= OPEN**2)

    @property
    def stays_open(self) -> NDArray[np.bool_]:
        """True where Newton's method has converged but closing equations remain violated."""
        return (self.following <= CLOSED**2) & self.contracts & ~(self.open <= OPEN**2)


class VariantLanes:
    """A program bound to buffers, with one row per number and one column per lane."""

    def __init__(self, program: Any, symbols: Symbols, lanes: int) -> None:
        sizes = 3 * len(symbols.y) + 1, len(symbols.predicted), len(symbols.near), len(symbols.numbers)
        self.given, self.start, self.near, self.numbers = inputs = [np.zeros((size, lanes)) for size in sizes]
        self.out = np.zeros((len(program.program.outputs), lanes))
        self.run = program.bind(inputs, [self.out])


class Variants:
    """Inverse dynamics of a scene as a function of samples and of the machine's parameters.

    Attributes:
        names, nominal: Full names of the parameters, and their values in the scene. Shape (P,).
        quantities, components: Computed quantities, and the components of each.
    """

    def __init__(self, scene: Scene, quantities: Iterable[str], parameters: Sequence[str], backend: str) -> None:
        """Follow the scene's motion; programs are traced and compiled on first use.

        Raises:
            ScrewgaugeError: A parameter does not exist, or the motion cannot be followed or traced.
        """
        self.scene, self.quantities, self.backend = scene, tuple(quantities), backend
        known = numbers(scene.mechanism, scene.applied)
        names = resolve(known, check_choice_of_text(parameters), "compile, parameters")
        self._known = {name: known[name] for name in names}
        self.names, self.nominal = tuple(names), np.array([*self._known.values()])
        self._machine = NominalMachine(scene, self.quantities)
        self.components = self._machine.components
        self._matter = Matter(self._machine, self.names, backend)
        self._programs: dict[int, tuple[Symbols, Any]] = {}
        self._bound: dict[tuple[int, int], VariantLanes] = {}
        self._steps = STEPS[0]
        self._at: tuple[ClosedSamples | None, Array] = None, np.zeros(0)

    @property
    def operations(self) -> int:
        """Number of operations that the program executes for one sample of one variant."""
        return len(self._program(self._steps)[1].program.code)

    @cached_property
    def cannot_change(self) -> dict[str, float]:
        """Parameters that remove the machine's mobility if changed alone, see `Slopes.costs`."""
        return self._slopes.costs()

    @cached_property
    def can_change_together(self) -> list[dict[str, float]]:
        """Combinations of parameters that preserve mobility, each with a parameter of its own, see `Slopes`."""
        return self._slopes.combinations()

    def __call__(
        self, y: Array, yd: Array, ydd: Array, *, parameters: Mapping[str, Any], t: Array | None = None
    ) -> VariantSolution:
        """Compute all quantities of all variants at all samples.

        Args:
            y, yd, ydd: Independent coordinates [rad or m] and derivatives. Shape (n, k).
            parameters: Full name, short name or pattern -> values of the parameters in all variants, shape (V,), or one
                common value. Parameters that are not given keep the scene's values.
            t: Times [s]. If given, the rows form a motion, which is followed from the home pose. Shape (n,).

        Raises:
            ScrewgaugeError: An array or a name is invalid, or the nominal machine cannot reach a sample.
        """
        poses, p = self._machine.at(y, yd, ydd, t), self._numbers(parameters)
        n, count = len(y), p.shape[1]
        values = {name: np.empty((n, len(names), count)) for name, names in self.components.items()}
        why = np.full(count, "", dtype=REASON)
        for some in self._chunks(n, count):
            self._fill(poses, p[:, some], [array[..., some] for array in values.values()], why[some])
        return VariantSolution({name: np.moveaxis(array, 2, 0) for name, array in values.items()}, why)

    def statistics(
        self,
        y: Array,
        yd: Array,
        ydd: Array,
        which: Sequence[str] = ("peak", "rms"),
        *,
        parameters: Mapping[str, Any],
        t: Array | None = None,
    ) -> dict[str, VariantSolution]:
        """Compute statistics over the samples of each variant, without storing the samples.

        Args:
            which: Names of `STATISTICS`. For all other arguments, see `__call__`.

        Returns:
            Statistic -> quantity -> values of shape (V, n_component).
        """
        check_choice("statistic", which, STATISTICS, "statistics")
        poses, p = self._machine.at(y, yd, ydd, t), self._numbers(parameters)
        n, count = len(y), p.shape[1]
        found = {one: {name: np.empty((count, len(c))) for name, c in self.components.items()} for one in which}
        why = np.full(count, "", dtype=REASON)
        for some in self._chunks(n, count):
            arrays = [np.empty((n, len(names), some.stop - some.start)) for names in self.components.values()]
            self._fill(poses, p[:, some], arrays, why[some])
            for one, by_quantity in found.items():
                for name, array in zip(self.quantities, arrays, strict=True):
                    by_quantity[name][some] = STATISTICS[one](array).T
        return {one: VariantSolution(values, why) for one, values in found.items()}

    def gradient(self, weights: Mapping[str, Array], y: Array, yd: Array, ydd: Array, t: Array | None = None) -> Array:
        """Differentiate a weighted sum of quantities with respect to all parameters, at each sample of the nominal
        machine.

        To differentiate the peak of a component, set its weight to the sign of the component at the sample of the peak,
        and to 0 elsewhere. For the root mean square, set the weight to ``f / (n rms)``. Then sum the result over the
        samples.

        Args:
            weights: Quantity -> weight of each component. Shape (n, n_component) or (n_component,).

        Returns:
            Shape (n, P).
        """
        poses = self._machine.at(y, yd, ydd, t)
        check_choice("quantity", weights, self.quantities, "gradient")
        parts = [np.broadcast_to(weights.get(name, 0.0), (len(y), len(c))) for name, c in self.components.items()]
        return self._pull_back(poses, np.concatenate(parts, axis=1))

    def jacobian(self, quantity: str, y: Array, yd: Array, ydd: Array, t: Array | None = None) -> Array:
        """Return derivatives of a quantity's components with respect to all parameters. Shape (n, n_component, P)."""
        poses = self._machine.at(y, yd, ydd, t)
        check_choice("quantity", [quantity], self.quantities, "jacobian")
        first = sum(len(self.components[name]) for name in self.quantities[: self.quantities.index(quantity)])
        units = np.eye(self._machine.count)[first : first + len(self.components[quantity])]
        return np.stack([self._pull_back(poses, np.tile(unit, (len(y), 1))) for unit in units], axis=1)

    # internal steps

    def _numbers(self, parameters: Mapping[str, Any]) -> Array:
        """Return the parameters of all variants. Shape (P, V)."""
        given = {name: np.asarray(x, dtype=float) for name, x in parameters.items()}
        counts = {len(x) for x in given.values() if x.ndim == 1} or {1}
        if len(counts) > 1 or any(x.ndim > 1 for x in given.values()):
            shapes = ", ".join(f"{name} {x.shape}" for name, x in given.items())
            raise DescriptionError(f"shapes differ: {shapes}", "parameters", "pass one value or V values per parameter")
        p = np.repeat(self.nominal[:, None], counts.pop(), axis=1)
        for pattern, x in given.items():
            check_finite(np.atleast_1d(x)[:, None], f"parameters, {pattern}")
            for name in resolve(self._known, [pattern], "parameters"):
                p[self.names.index(name)] = x
        return p

    def _chunks(self, n: int, count: int) -> Iterator[slice]:
        """Yield slices of variants small enough for the cache."""
        lanes = min(LANES, max(8, HELD // max(1, n * self._machine.count)))
        return (slice(i, min(i + lanes, count)) for i in range(0, count, lanes))

    def _fill(self, poses: ClosedSamples, p: Array, into: Sequence[Array], why: Any) -> None:
        """Fill in the values of variants or the reasons why they have none; arrays in `into` have shape (n, m, V)."""
        why[~self._matter.possible(p)] = IMPOSSIBLE
        if all(map(inertial, self.names)):
            self._matter.fill(poses, p, into)
        else:
            self._answer(poses, p, into, why)
        for array in into:
            array[..., why != ""] = np.nan

    def _answer(self, poses: ClosedSamples, p: Array, into: Sequence[Array], why: Any) -> None:
        """Fill in values with the program; the array solver solves variants that leave the assembly mode."""
        left, far = np.flatnonzero(why == ""), list[int]()
        for again in range(AGAIN):
            some = [np.empty((*array.shape[:2], len(left))) for array in into]
            worst = self._run(poses, p[:, left], some, again)
            if self._steps == STEPS[0] and np.mean(worst.contracts & ~(worst.closed | worst.stays_open)) > MANY:
                self._steps = STEPS[1]
                worst = self._run(poses, p[:, left], some, again)
            for array, found in zip(into, some, strict=True):
                array[..., left] = found
            why[left[worst.stays_open]] = ROWS_OPEN
            far += left[~worst.contracts].tolist()
            left = left[worst.contracts & ~(worst.closed | worst.stays_open)]
            if not left.size:
                break
        for lane in [*far, *left.tolist()]:
            why[lane] = self._solve_variant(poses, p[:, lane], [array[..., lane] for array in into])

    def _run(self, poses: ClosedSamples, p: Array, into: Sequence[Array], again: int) -> _Worst:
        """Run the program at all samples, rerun it `again` times from its last poses, and fill in the values."""
        symbols, made = self._program(self._steps)
        count, key = p.shape[1], (self._steps, min(LANES, -(-p.shape[1] // 8) * 8))
        if key not in self._bound:
            self._bound[key] = VariantLanes(made, symbols, key[1])
        lanes, worst = self._bound[key], _Worst(count)
        lanes.numbers[:] = self.nominal[:, None]
        lanes.numbers[:, :count] = p
        change, slopes = lanes.numbers - self.nominal[:, None], self._slopes_at(poses)
        ends = np.cumsum([0, *(array.shape[1] for array in into)]).tolist()
        checks = slice(ends[-1], ends[-1] + len(CHECKS))
        with np.errstate(all="ignore"):
            for i, (row, q) in enumerate(zip(poses.given, poses.q, strict=True)):
                lanes.given[:], lanes.near[:] = row[:, None], q[symbols.near, None]
                np.matmul(slopes[i], change, out=lanes.start)
                lanes.start += q[symbols.predicted, None]
                for _ in range(again):
                    lanes.run()
                    lanes.start[:] = lanes.out[checks.stop :]
                lanes.run()
                worst.meet(*lanes.out[checks, :count])
                for array, first, end in zip(into, ends, ends[1:], strict=False):
                    array[i] = lanes.out[first:end, :count]
        return worst

    def _solve_variant(self, poses: ClosedSamples, p: Array, into: Sequence[Array]) -> str:
        """Solve a variant with the array solver, starting from its own home pose; return the reason if this fails."""
        motion = GivenMotion(poses.t, poses.y, poses.yd, poses.ydd)
        try:
            scene = self.scene.with_({name: float(x) for name, x in zip(self.names, p, strict=True)})
            work = Work(layout(scene.mechanism), scene.problem(self.quantities))
            part = work.part(motion, work.close(motion, work.predict(motion)))
        except ScrewgaugeError:
            return NOT_CLOSED
        for name, array in zip(self.quantities, into, strict=True):
            array[:] = part.values[name]
        return ""

    def _program(self, steps: int) -> tuple[Symbols, Any]:
        """Return equations with `steps` Newton steps, and their program for quantities, checks and coordinates."""
        if steps not in self._programs:
            symbols = self._machine.symbols(self._known, steps)
            outputs = [*self._machine.outputs(symbols), *symbols.checks(), *symbols.reached]
            self._programs[steps] = symbols, runner(symbols.program(outputs), self.backend)[0]
        return self._programs[steps]

    @cached_property
    def _slopes(self) -> Slopes:
        return Slopes(self._machine, self._known)

    def _slopes_at(self, poses: ClosedSamples) -> Array:
        """Return parameter derivatives of the dependent coordinates, cached for the next call. (n, c, P)."""
        if self._at[0] is not poses:
            self._at = poses, self._slopes.of(poses)[0]
        return self._at[1]

    @cached_property
    def _pull(self) -> tuple[Symbols, Any]:
        """Equations and program for the gradient at closed poses; the weights are the last inputs."""
        symbols = self._machine.symbols(self._known, 0)
        values = self._machine.outputs(symbols)
        weights = [symbols.trace.input(np.ones(len(self._machine.anchors))) for _ in values]
        return symbols, runner(symbols.program(gradient(symbols, values, weights)), self.backend)[0]

    def _pull_back(self, poses: ClosedSamples, weights: Array) -> Array:
        symbols, run = self._pull
        out = np.empty((len(self.names), len(poses.q)))
        run.bind([stack_inputs(symbols, poses, self.nominal), np.ascontiguousarray(weights.T)], [out])()
        return np.ascontiguousarray(out.T)


def check_choice_of_text(names: Any) -> list[str]:
    """Return names or patterns as a list.

    Raises:
        DescriptionError: The value is not a nonempty list of strings.
    """
    if isinstance(names, str) or not isinstance(names, Iterable) or not (wanted := [*names]):
        raise DescriptionError(
            "expected a nonempty list of names", "compile, parameters", 'pass a list such as ["*.mass"]'
        )
    return wanted
