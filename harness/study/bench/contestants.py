"""Contestants of benches, and their selection. A contestant pairs a method with a question.

``cases.toml`` lists the contestants for given motions, and the engines' own steppers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain, product
from typing import Any

from screwgauge.engines.methods import METHODS
from screwgauge.engines.registry import engines, get_engine
from screwgauge.models.mjcf import PARTS
from screwgauge.problem import InitialValue
from screwgauge.quantities import GIVEN, NUMBER_TYPES, OF_BODIES, OF_JOINTS, NumberType, number_type
from screwgauge.quantities import QUANTITIES as EVERY
from screwgauge.reference.errors import check_choice
from screwgauge.reference.expressions import number
from screwgauge.scene.simulation import EXPLICIT
from screwgauge.solution import Solution
from screwgauge.study.bench import TABLE, given
from screwgauge.study.bench.given import Question, Trial
from screwgauge.study.bench.variants import VARIANTS, variant
from screwgauge.study.methods import Method
from screwgauge.study.reference_values import QUANTITIES, PreparedScene, join_samples

#: Quantity of contestants that compute nothing.
NOTHING = "none"


def count(n: int, word: str) -> str:
    """Return a count with its noun: ``1 pass``, ``2 passes``."""
    ending = "es" if word.endswith("s") else "s"
    return f"{n} {word}{'' if n == 1 else ending}"


@dataclass(frozen=True, slots=True, eq=False)
class Contestant:
    """Method with a setting and a question, which yields a row for each of its quantities.

    Attributes:
        setting: Description of the setting.
        covers: Work that the clock includes.
        series: Subdivision of the family, such as ``1 iteration``, whose contestants form one line.
        parameter: Name and value of the parameter that varies along that line.
        label: Short name of the setting in diagrams.
        drawn: True if the work-precision diagram shows the contestant.
        given: True if the joint motion is prescribed, so that the time excludes closing the loops.
        hint: Likely cause of a failure, for the row of that failure.
    """

    family: str
    name: str
    setting: str
    method: Method
    question: Question
    quantities: tuple[str, ...]
    covers: str
    series: str = ""
    parameter: tuple[str, float] | None = None
    label: str = ""
    drawn: bool = True
    given: bool = False
    hint: str = ""

    @property
    def key(self) -> str:
        """Identifier of the contestant within a bench."""
        return " | ".join((self.name, self.method.engine, self.series, self.setting, ", ".join(self.quantities)))

    @property
    def kind(self) -> NumberType:
        """Number type in which the method computes."""
        return NUMBER_TYPES.get(self.method.settings.get("dtype", ""), number_type(self.method.engine))

    @property
    def line(self) -> str:
        """Name of the contestant's line in a diagram: family, or family and series."""
        return f"{self.family} ({self.series})" if self.series else self.family

    def ask(self, posed: PreparedScene) -> Trial:
        """Pose the contestant's question for a scene."""
        return self.question(posed, self.method.engine, self.quantities)

    def scores(self, trial: Trial, solutions: Sequence[Solution]) -> dict[str, tuple[float, float, str]]:
        """Return quantity -> largest and RMS scaled errors, and a reason if there is no error."""
        scores = {}
        for quantity in self.quantities if self.quantities != (NOTHING,) else ():
            values = join_samples(solution.values[quantity] for solution in solutions)
            score = trial.reference.score(quantity, values if trial.rows is None else values.at(trial.rows))
            reason = f"{score.reason}: {self.hint}" if score.reason and self.hint else score.reason
            scores[quantity] = score.error, score.rms, reason
        return scores


#: Fields of a contestant that are copied from an entry of ``cases.toml``.
_AS_IT_IS = ("family", "name", "setting", "covers", "series", "label", "drawn", "given", "hint")

_COVERS = "integration from start to end, closing of the loops and output at the samples; loading outside"
_SIMULATOR = partial(Contestant, question=given.simulation, quantities=("observable", "energy"), covers=_COVERS)
#: Tolerances of a step, rtol = atol. Implicit methods of low order would need too many steps for the smaller ones.
LADDER = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
LEAST_IMPLICIT = 1e-8
QUICK_LADDER = (1e-4, 1e-7)
#: Smallest useful tolerance for engines that close loops by constraint forces, whose rounding errors exceed it.
LEAST_CONSTRAINED = 1e-10
#: Numbers of equal steps over the whole motion.
STEPS = (250, 1_000, 4_000, 16_000, 64_000)
QUICK_STEPS = (100, 400, 1_600)


#: Family of the contestants in ``leaving_out.csv``.
LEAVING_OUT = "leaving-out"
ENGINES = ("screw", "pinocchio", "mujoco")
EVERYTHING = "everything"
#: Quantities that each row requests in addition to those of the previous row.
WANTED = {
    **{
        what: tuple(name for name in (*OF_JOINTS, *OF_BODIES) if EVERY[name].needs == needs)
        for what, needs in (("positions only", "q"), ("+ velocities", "v"), ("+ accelerations", "a"))
    },
    "+ generalised forces": ("generalized_force",),
    "+ actuator forces": ("actuator_force",),
    "+ reactions": ("reaction",),
}
MOTION = tuple(name for step in list(WANTED)[:3] for name in WANTED[step])


def contestants(*, quick: bool) -> list[Contestant]:
    """Return the contestants, sorted by family. `quick`: omit the slowest settings."""
    return [*(one for entry in TABLE["lines"] for one in _expand(entry, quick)), *leaving_out()]


def _expand(entry: Mapping[str, Any], quick: bool) -> Iterator[Contestant]:
    """Yield the contestants of an entry of ``cases.toml``; comments at the top of that file explain its entries."""
    axes = [
        [value if isinstance(value, dict) else {name: value} for value in values]
        for name, values in entry.get("over", {}).items()
    ]
    for quantities in [{"quantities": [name]} for name in QUANTITIES] if "each" in entry else [{}]:
        for combination in product([{**entry, **quantities}], *axes):
            values = {name: value for table in combination for name, value in table.items()}
            if not (quick and "slow" in values):
                yield _contestant(values)


def _contestant(values: Mapping[str, Any]) -> Contestant:
    def fill(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: fill(inner) for name, inner in value.items()}
        if isinstance(value, str):
            return values.get(value[1:]) if value.startswith("$") else value.format(**values)
        return value

    fields = {name: fill(values[name]) for name in _AS_IT_IS if name in values}
    arguments = fill(values["question"])
    question = getattr(given, arguments.pop("ask"))
    parameter = None
    if varied := values.get("parameter"):
        parameter = varied[0], number(fill(varied[1]), "cases.toml")
    if "named" in values and (parameter is None or parameter[1] not in values["named"]):
        fields["label"] = ""
    settings = fill(values.get("settings", {}))
    method = Method(values["engine"], settings)
    if "variant" in values:
        method = variant(values["engine"], VARIANTS[values["variant"]], **settings)
    return Contestant(
        **fields,
        method=method,
        question=partial(question, **arguments) if arguments else question,
        quantities=tuple(values["quantities"]),
        parameter=parameter,
    )


def leaving_out() -> Iterator[Contestant]:
    """Yield each engine with reduced requests, to measure savings; an engine's first contestant computes everything."""
    for engine in ENGINES:
        covers = f"from y and its derivatives: the engine {engine}, model loaded"
        any_engine = partial(Contestant, LEAVING_OUT, LEAVING_OUT, covers=covers, drawn=False)
        trial = partial(any_engine, method=Method(engine))
        yield trial(EVERYTHING, question=given.omit, quantities=GIVEN)
        wanted: tuple[str, ...] = ()
        for step, names in WANTED.items():
            wanted += names
            yield trial(step, question=partial(given.omit, computed=wanted), quantities=wanted, series="asked for")
        setting, alone = "actuator forces alone", ("actuator_force",)
        yield trial(setting, question=partial(given.omit, computed=alone), quantities=alone, series="asked for")
        for absent in ("gravity", "load"):  # without them, forces change but motion does not
            yield trial(absent, question=partial(given.omit, absent=absent), quantities=MOTION, series="absent")
        # parts of the model file that mechanics does not need; a URDF can contain only limits
        for part in {"screw": (), "pinocchio": ("limits",), "mujoco": (*PARTS, given.ALL_PARTS)}[engine]:
            setting = "visuals" if part == "geoms" else part
            yield trial(setting, question=partial(given.omit, part=part), quantities=GIVEN, series="in the model")
        if engine != "screw":  # joint forces of the tree differ between cuts
            same, cut = tuple(name for name in GIVEN if not name.startswith("tree_force")), Method(f"{engine}-full")
            yield any_engine("full cut instead of minimal", cut, given.omit, same, series="cut")


def choose(wanted: Iterable[str] | None, *, quick: bool = False) -> list[Contestant]:
    """Return the contestants with the given names or families; by default all contestants whose packages are installed.

    Raises:
        ScrewgaugeError: A name is unknown, or no name is given.
    """
    everyone = contestants(quick=quick)
    if wanted is None:
        return [one for one in everyone if not (entry := get_engine(one.method.engine)).extra or entry.installed]
    known = contestants(quick=False)
    names = dict.fromkeys([*(c.family for c in known), *(c.name for c in known)])
    chosen = set(check_choice("contestant", wanted, names))
    return [contestant for contestant in everyone if {contestant.family, contestant.name} & chosen]


def simulators(method: str, duration: float, *, quick: bool) -> list[Contestant]:
    """Return the contestants for the bench of a simulation, sorted by family, coarse settings first."""
    return [*chain(*_ladders(method, quick), *_step_ladders(duration, quick))]


def _ladders(usual: str, quick: bool) -> Iterator[list[Contestant]]:
    """Yield series of decreasing tolerances, one for each engine and integration method of scipy."""
    for engine in (name for name, engine in engines().items() if InitialValue in engine.tasks):
        screw = engine == "screw"
        for method in METHODS if screw else (usual,):
            least = max(0.0 if screw else LEAST_CONSTRAINED, 0.0 if method in EXPLICIT else LEAST_IMPLICIT)
            rungs = [rtol for rtol in (QUICK_LADDER if quick else LADDER) if rtol >= least]
            if screw and quick and method != usual:  # a quick bench uses all tolerances only for the scene's own method
                rungs = rungs[:1]
            family, ladder = f"screw-{method}" if screw else engine, list[Contestant]()
            for rtol in rungs:
                setting, label = f"{method}, rtol = atol = {rtol:.0e}", f"{rtol:.0e}".replace("e-0", "e-")
                question = partial(given.simulation, method=method, rtol=rtol)
                ladder.append(_SIMULATOR(family, family, setting, Method(engine), question=question, label=label))
            yield ladder


def _step_ladders(duration: float, quick: bool) -> Iterator[list[Contestant]]:
    """Yield series of decreasing fixed steps, one for each engine's own stepper; external engines must be installed."""
    for stepper in TABLE["steppers"]:
        family, engine, rungs = stepper["family"], stepper["engine"], list[Contestant]()
        if get_engine(engine).extra and not get_engine(engine).installed:
            continue
        for dt in (duration / n for n in (QUICK_STEPS if quick else STEPS)):
            method, setting = Method(engine, {"dt": dt, **stepper["settings"]}), stepper["setting"].format(dt=dt)
            rungs.append(_SIMULATOR(family, family, setting, method, parameter=("dt [s]", dt), label=_label(dt)))
        yield rungs


def _label(dt: float) -> str:
    """Format a time step with a suitable unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9)):
        if dt >= size:
            return f"{dt / size:.3g} {unit}"
    return f"{dt:.1e} s"
