"""The engines that integrate. A further one is a function ``integrate(problem)``, and one line here."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module
from typing import cast

from screwgauge.engines.registry import GENERATED, Integrator
from screwgauge.reference.errors import DescriptionError, check_choice

#: Name -> module and function; imported only when used.
INTEGRATORS = {
    "screw": "screwgauge.engines.screw.forward:integrate",
    "pinocchio": "screwgauge.engines.pinocchio.mover:integrate",
    "mujoco": "screwgauge.engines.mujoco.mover:integrate",
}


def check_integrators(names: Iterable[str], where: str = "") -> tuple[str, ...]:
    """The names, once each, in the order given.

    Raises:
        ScrewgaugeError: There is none, or one of them does not integrate.
    """
    known = {*INTEGRATORS, *GENERATED, "truth"}
    wanted = dict.fromkeys(check_choice("engine", names, [*INTEGRATORS, *sorted(known - {*INTEGRATORS})], where))
    odd = [name for name in wanted if name not in INTEGRATORS]
    if odd:
        raise DescriptionError(f"engine '{odd[0]}' does not integrate", where, f"choose from {', '.join(INTEGRATORS)}")
    return tuple(wanted)


def load_integrator(name: str) -> Integrator:
    """Imports an engine.

    Raises:
        ImportError: Its package is not installed.
    """
    module, function = INTEGRATORS[name].split(":")
    return cast(Integrator, getattr(import_module(module), function))
