"""The engines. A further one is one file with a function ``solve(problem) -> Solution``, and one line here."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module
from typing import cast

from screwgauge.problem import ForwardProblem, OldProblem
from screwgauge.reference.errors import check_choice
from screwgauge.solution import ForwardSolution, Solution

Engine = Callable[[OldProblem], Solution]
Integrator = Callable[[ForwardProblem], ForwardSolution]

#: Name -> module and function; imported only when used.
ENGINES = {
    "screw": "screwgauge.engines.screw.inverse:solve",
    "pinocchio": "screwgauge.engines.pinocchio.tree:solve",
    "mujoco": "screwgauge.engines.mujoco.tree:solve",
    "pinocchio-full": "screwgauge.engines.pinocchio.tree:solve",
    "mujoco-full": "screwgauge.engines.mujoco.tree:solve",
    "truth": "screwgauge.engines.truth:solve",
}

MEANINGS = {
    "screw": "the screw-based solver of this project",
    "pinocchio": "Pinocchio on the URDF, minimal cut",
    "mujoco": "MuJoCo on the MJCF, minimal cut",
    "pinocchio-full": "Pinocchio, all joints in the tree",
    "mujoco-full": "MuJoCo, all joints in the tree",
    "truth": "ball arithmetic with rigorous radii, on request (needs python-flint)",
}


def check_engines(names: Iterable[str], where: str = "") -> tuple[str, ...]:
    """The names, once each, in the order given.

    Raises:
        ScrewgaugeError: There is none, or one of them is no engine.
    """
    return tuple(dict.fromkeys(check_choice("engine", names, ENGINES, where)))


def load_engine(name: str) -> Engine:
    """Imports an engine.

    Raises:
        ImportError: Its package is not installed.
    """
    module, function = ENGINES[name].split(":")
    return cast(Engine, getattr(import_module(module), function))


#: Engine -> cut and ending of the generated model that it reads; any other engine reads the description.
GENERATED = {
    "pinocchio": ("minimal", ".urdf"),
    "mujoco": ("minimal", ".xml"),
    "pinocchio-full": ("full", ".urdf"),
    "mujoco-full": ("full", ".xml"),
}
