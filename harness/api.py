"""Functions of the package for Python. Each function imports what it needs when it is called."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from screwgauge.diagnosis.deadline import LIMIT

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from screwgauge.diagnosis.model import Loops, Read, Weighed
    from screwgauge.engines.screw.compiled import Solver
    from screwgauge.engines.screw.variants import Variants
    from screwgauge.report.diagnosed import DiagnosisReport
    from screwgauge.report.pages.check import CheckReport
    from screwgauge.report.results import Results
    from screwgauge.report.reviewed import ReviewReport
    from screwgauge.scene.observables import Recorded
    from screwgauge.scene.scene import Scene
    from screwgauge.study.isolation import Limits


def run(
    scene: Scene,
    engines: Iterable[str] | None = None,
    quantities: Iterable[str] | None = None,
    *,
    progress: Callable[[str, float], None] = lambda step, share: None,
    warn: Callable[[str], None] = lambda sentence: None,
    limits: Limits | None = None,
) -> Results:
    """Compare engines on a scene: each reads its own model file; all pairs are compared, and each answer is judged.

    Args:
        engines: Names of engines, optionally with a number type as in ``screw@float32``; by default as in the scene.
        quantities: Names of the quantities to compute; by default as in the scene.
        progress: Called during the work with the name of a step and its completed share, 0 to 1.
        warn: Called with a warning before a step that may take long or fail.
        limits: Run each engine in its own process under these limits, as the command line does; an engine that crashes
            or hangs then becomes a row, too. By default engines run in this process, which is faster for small scenes
            and can be debugged; only engines of other packages run in their own.

    Raises:
        ScrewgaugeError: The input is invalid. An engine that fails becomes a row of the results, not an error.
    """
    from screwgauge.report.results import Results
    from screwgauge.study.run import run as compared

    with np.errstate(all="ignore"):  # values that are not numbers become rows with a reason
        comparison = compared(scene, engines, quantities, progress=progress, warn=warn, limits=limits)
    return Results.of(comparison)


def check(
    *what: str | Path,
    smoke: bool = False,
    tolerances: str | Path | Mapping[str, float] | None = None,
    baseline: str | Path | None = None,
    jobs: int = 1,
    limits: Limits | None = None,
    meshes: bool = False,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> CheckReport:
    """Compare engines on scenes, or compare pairs of model files, against tolerances.

    Args:
        what: Built-in scenes, TOML files, or folders with TOML files, at least one; two model files form a pair.
        smoke: Use a few samples of an exciting motion instead of the scene's own motion.
        tolerances: Quantity -> allowed scaled error, or a TOML file with them; tolerances in a scene take precedence.
        baseline: File written by an earlier check; the check fails if an error has grown since.
        jobs: Number of parallel processes; takes effect only with `limits`.
        limits: Check each scene in its own process under these limits; by default scenes are checked in this process,
            and only engines of other packages run in their own.
        meshes: Let MuJoCo compute mass and inertia of the bodies of MJCFs from meshes in their folders.
        progress: Called during the work with the current step and the completed share of all work.

    Raises:
        ScrewgaugeError: The input is invalid. A fault of a single scene becomes a row, not an error.
    """
    from screwgauge.reference.errors import DescriptionError
    from screwgauge.report.pages.check import check_with
    from screwgauge.study.runner import InTurn, Processes

    if not what:
        raise DescriptionError("there is nothing to check", "check", "pass scenes, folders or model files")
    execute = InTurn() if limits is None else Processes(jobs, limits)
    more: dict[str, Any] = {"smoke": smoke, "tolerances": tolerances, "baseline": baseline, "meshes": meshes}
    return check_with(execute, what, **more, progress=progress)


def diagnose(
    a: str | Path | Weighed,
    b: str | Path | Weighed,
    *,
    map: str | Path | Mapping[str, str] | None = None,
    seed: int = 0,
    loops: Loops = None,
    limit: float = LIMIT,
    load: Read | None = None,
    only: str = "",
) -> DiagnosisReport:
    """Compare two models of a machine, explain their differences, and prove the explanation.

    Links, joints and loops are compared regardless of where a file cuts the loops. Joints are paired by name, or else
    by geometry. If B as a whole is displaced, rotated, mirrored or in different units, that counts as one cause. The
    share of each cause in the torque difference at random states is computed by putting B's values into A. As a proof,
    B's file is corrected and read again.

    Args:
        a, b: URDF, MJCF, SDF, USD or description (name or path), or ``FILE@LIBRARY`` to let ``pinocchio``, ``mujoco``
            or ``yourdfpy`` read the file.
        map: Joints and bodies of A -> their partners in B, where names and geometry are ambiguous; or a TOML file with
            this table.
        seed: Seed of the random states.
        loops: File with the loop closures of URDFs, ``robot.yaml`` or ``.loops.toml``, if it is not next to the URDF:
            one file for both models, or one for each (None for the file next to the URDF).
        limit: Time after which no further step begins, 3600 by default [s]; `left_out` names the omitted steps.
        load: Function that reads a file; by default files are read in this process, which ends if a library crashes.
        only: ``rigid`` compares only geometry, masses and inertias; by default everything is compared.

    Returns:
        The diagnosis, which is true if the two models are the same. `verdict` is a sentence or two, each of the
        `differences` and `causes` has a `sentence`, and `write_fix` writes a corrected B.

    Raises:
        ScrewgaugeError: A model file or the map cannot be read, or the loops of neither model close.
    """
    from screwgauge.diagnosis.diagnose import diagnose as compared
    from screwgauge.diagnosis.model import read_here
    from screwgauge.report.diagnosed import DiagnosisReport

    load = load or read_here
    return DiagnosisReport.of(compared(a, b, map=map, seed=seed, loops=loops, limit=limit, load=load, only=only))


def import_model(
    model: Any,
    constraints: Iterable[Any] = (),
    *,
    q: ArrayLike | None = None,
    independent: Iterable[str] | None = None,
    actuated: Iterable[str] | None = None,
) -> Scene:
    """Make a scene from a Pinocchio model that was built in Python, with the constraints that close its loops.

    Args:
        model: A ``pinocchio.Model``.
        constraints: Constraint models of points (3D) or frames (6D) that coincide.
        q: A configuration near which the loops close; by default the neutral configuration. Shape (nq,).
        independent, actuated: Names of joints; by default chosen as for a model file.

    Raises:
        ScrewgaugeError: `model` is not a Pinocchio model, its loops do not close, or a chosen joint does not fit.
    """
    from screwgauge.models.importing.model import Options
    from screwgauge.scene.default import write_model
    from screwgauge.scene.read import load_scene

    chosen = None if independent is None else {name: name for name in independent}
    driven = None if actuated is None else [*actuated]
    return load_scene(write_model(model, [*constraints], q, Options(independent=chosen, actuated=driven)))


def review(
    numbers: str | Path | Recorded, scene: Scene | str | Path, quantities: Iterable[str] | None = None
) -> ReviewReport:
    """Find the faults in a table of numbers, column by column, and prove them by correcting the table.

    Args:
        numbers: A CSV or Parquet file, or arrays.
        scene: The scene that the numbers describe; its times may differ from the times in the table.
        quantities: Names of the quantities to review; all by default.

    Returns:
        The review, which is true if all columns agree to their printed digits. `verdict` is a sentence or two, and each
        of the `columns` has `faults`.

    Raises:
        ScrewgaugeError: The table, the scene or a quantity is invalid.
    """
    from screwgauge.report.blocks import as_kind
    from screwgauge.report.reviewed import ReviewReport
    from screwgauge.scene.observables import read_recorded
    from screwgauge.scene.read import load_scene
    from screwgauge.scene.scene import Scene
    from screwgauge.study.run import review as reviewed

    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    table = read_recorded(Path(numbers)) if isinstance(numbers, (str, Path)) else numbers
    return as_kind(ReviewReport, reviewed(table, scene, quantities))


@overload
def compile(
    scene: Scene,
    quantities: Iterable[str] | None = None,
    *,
    backend: str = "llvm",
    threads: int = 1,
    parameters: None = None,
) -> Solver: ...


@overload
def compile(
    scene: Scene, quantities: Iterable[str] | None = None, *, backend: str = "llvm", parameters: Sequence[str]
) -> Variants: ...


def compile(
    scene: Scene,
    quantities: Iterable[str] | None = None,
    *,
    backend: str = "llvm",
    threads: int = 1,
    parameters: Sequence[str] | None = None,
) -> Solver | Variants:
    """Compile a fast function for the inverse dynamics of a scene.

    Args:
        quantities: Names of the quantities to compute; by default as in the scene.
        backend: ``llvm`` (extra ``fast``) or ``numpy``.
        threads: Number of parallel threads; must be 1 if `parameters` are given.
        parameters: Numbers of the machine, by name or pattern as in `Scene.with_`, that become additional inputs.

    Returns:
        With parameters, a function ``variants(y, yd, ydd, parameters={name: values})`` of arrays of shape (n, k), whose
        results have shape (V, n, n_component), see `screwgauge.engines.screw.variants.Variants`. Without parameters, a
        function ``solver(y, yd, ydd, out=None)`` of plain float64 arrays of shape (n, k). ``solver.buffers(n)``, or
        ``solver.buffers(n, {quantity: array})`` with arrays of your own, makes an ``out`` that each call refills.
        Rows that cannot be solved, or whose values are not finite, raise an error.

    Raises:
        ScrewgaugeError: The input is invalid, or the motion cannot be followed.
    """
    from screwgauge.engines.screw.compiled import Solver
    from screwgauge.quantities import OF_MOTION, check_quantities
    from screwgauge.reference.errors import DescriptionError, check_choice, quote
    from screwgauge.scene.preflight import determined_at_home
    from screwgauge.scene.scene import check_scene_type

    check_scene_type(scene, "compile")
    check_choice("backend", [backend], ("numpy", "llvm"), "compile")
    if not (isinstance(threads, int) and threads > 0):
        raise DescriptionError(f"cannot use {quote(threads)} threads", "compile", "use a positive whole number")
    wanted = check_quantities(scene.quantities if quantities is None else quantities, "compile", OF_MOTION)
    wanted, left = determined_at_home(scene, wanted) if quantities is None else (wanted, ())
    if parameters is not None:
        from screwgauge.engines.screw.variants import Variants

        if threads != 1:
            raise DescriptionError(f"cannot use {threads} threads", "compile, parameters", "omit threads")
        return Variants(scene, wanted, parameters, backend)
    solver = Solver(scene, wanted, backend, threads)
    solver.notes = (*left, *solver.notes)
    return solver
