"""Reproductions with EXUDYN."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import exudyn
import numpy as np
from exudyn.utilities import RigidBodyInertia

from casebook.toy_models import ARM, INERTIA, MASS, MOMENT, WEIGHT, Evidence, FourBar, G


@contextmanager
def _system() -> Iterator[Any]:
    """Make a silent, empty system."""
    told, exudyn.config.printToConsole = exudyn.config.printToConsole, False
    container = exudyn.SystemContainer()
    try:
        yield container.AddSystem()
    finally:
        exudyn.config.printToConsole = told


def _settings(end: float, steps: int) -> Any:
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = end, steps
    settings.solution.file.write = False
    return settings


def _fall(**options: bool) -> float:
    with _system() as system:
        inertia = RigidBodyInertia(MASS, MOMENT * np.eye(3), com=[ARM, 0.0, 0.0], **options)
        ground, bar = system.CreateGround(), system.CreateRigidBody(inertia=inertia, gravity=[0.0, 0.0, -G])
        system.CreateRevoluteJoint(itemNumbers=[ground, bar], position=[0.0, 0.0, 0.0], axis=[0.0, 1.0, 0.0])
        system.Assemble()
        system.SolveDynamic(_settings(1e-6, 1))
        return float(system.GetObjectOutputBody(bar, exudyn.OutputVariableType.AngularAcceleration)[1])


def inertia_about_origin() -> Evidence:
    return Evidence(_fall(), -WEIGHT / INERTIA, _fall(inertiaTensorAtCOM=True), "rad/s^2")


def _swing(*, free: bool, dense: bool) -> float:
    """Angular velocity of the crank after 0.1 s, from rest, of a four-bar [rad/s].

    Args:
        free: The last joint holds two translations only.
        dense: The solver passes over singular rows.
    """
    bar = FourBar(speed=0.0)
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(_ways(bar), axis=0)])
    with _system() as system:
        bodies = [system.CreateGround()]
        for at, way, mass, moment in zip(points, _ways(bar), bar.masses, bar.moments, strict=False):
            angle, length = np.arctan2(way[1], way[0]), np.hypot(*way)
            c, s = np.cos(angle), np.sin(angle)
            inertia = RigidBodyInertia(mass, moment * np.eye(3), com=[length / 2.0, 0.0, 0.0], inertiaTensorAtCOM=True)
            turned = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            place = {"referencePosition": [*at, 0.0], "referenceRotationMatrix": turned}
            bodies.append(system.CreateRigidBody(inertia=inertia, gravity=[0.0, -G, 0.0], **place))
        for i, at in enumerate(points):
            ends = {"itemNumbers": [bodies[i], bodies[(i + 1) % 4]], "position": [*at, 0.0]}
            if free and i == 3:
                system.CreateGenericJoint(**ends, constrainedAxes=[1, 1, 0, 0, 0, 0])
            else:
                system.CreateRevoluteJoint(**ends, axis=[0.0, 0.0, 1.0])
        system.Assemble()
        settings = _settings(0.1, 100)
        if dense:
            settings.linearSolver.solverType = exudyn.LinearSolverType.EigenDense
            settings.linearSolver.ignoreSingularJacobian = True
        system.SolveDynamic(settings)
        return float(system.GetObjectOutputBody(bodies[1], exudyn.OutputVariableType.AngularVelocity)[2])


def _ways(bar: FourBar) -> np.ndarray:
    crank, coupler, rocker = bar.lengths[:, None] * bar.along
    return np.array([crank, coupler, -rocker])


def planar_loop() -> Evidence:
    said = ""
    try:
        value = _swing(free=False, dense=False)
    except Exception as error:  # of EXUDYN's, which are of no common type
        value, said = float("nan"), str(error).partition(" [")[0]
    return Evidence(value, _swing(free=True, dense=False), _swing(free=False, dense=True), "rad/s", said)
