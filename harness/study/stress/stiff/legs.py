"""Stiff springs and dampers across the prismatic joints: accelerations, and a short motion with its energy."""

from __future__ import annotations

from collections.abc import Iterator

from screwgauge.study.stress.case import Case, Finding, Rung


def stiff_legs() -> Case:
    """The 3-UPS-UPU-S on four springs."""
    return Case(
        name="stiff-legs",
        title="Stiff springs and dampers in the legs",
        axis="stiffness [N/m]",
        about=(
            "Springs and dampers across all four prismatic joints, damping 1.2 times critical; the eigenvalues grow "
            "with the root of the stiffness to 1e5 1/s. Accelerations: round trip at the loaded default scene, "
            "the actuators taking over what the springs exert; a length is known to eps, a force to eps times "
            "stiffness times length, and the guard admits so much. Motion: 0.1 s from rest, 0.01 rad off, against "
            "collocation of order nineteen, and energy; Radau is given a tolerance of 1e-5, and steps times tolerance "
            "is what it admits. DOP853 is refused where stability alone asks for more than a hundred steps. The "
            "engines' own steps are of 0.1 ms, MuJoCo's loops as hard as it allows (d = 0.9999)."
        ),
        drawn="motion",
        low=1.0,
        high=1e11,
        full=(1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10),
        quick=(1e2, 1e8, 1e10),
        rung=lambda stiffness, quick: Rung(stiffness, lambda: climb(stiffness)),
    )


def climb(stiffness: float) -> Iterator[Finding]:
    """All engines at one stiffness."""
    from screwgauge.study.stress.stiff import accelerations as stiff_accelerations
    from screwgauge.study.stress.stiff import motion as stiff_motion

    yield from stiff_accelerations.climb(stiffness)
    yield from stiff_motion.climb(stiffness)
