"""Writes the description of the N-four-bar mechanism of benchmark problem A02, for any N."""

from __future__ import annotations


def four_bars(n: int, *, driven: bool = False) -> str:
    """The text (TOML) of N four-bars in a row: pivots A_k = (k, 0, 0), N + 1 upright links, N horizontal ones.

    The crank's angle counts from upright about z, so that the motion starts with a rate of -1 rad/s.

    Args:
        n: Number of four-bars, one or more.
        driven: Whether a motor turns the crank; the published problem has none.
    """
    lines = [
        f"# {n} four-bars in a row, benchmark problem A02 of the IFToMM library; written by models/fourbars.py.",
        "# Links of 1 m and 1 kg; all of them are horizontal at the singular poses, crank = -pi/2 and pi/2.",
        "# Only the moments of inertia about z matter; those about the links' axes are small but not zero, which",
        "# MuJoCo refuses.",
        f'name = "a02-fourbar-{n}"',
        f'title = "{n}-four-bar mechanism (A02)"',
        'group = "benchmark problems"',
        'source = "IFToMM library of computational benchmark problems, A02"',
        "",
        "[independent]",
        'crank = "a0"',
    ]
    for k in range(n + 1):
        lines += _link(f"upright{k}", "[0, 0.5, 0]", ("1/12", "0.001", "1/12"))
    for k in range(n):
        lines += _link(f"bar{k}", "[0.5, 0, 0]", ("0.001", "1/12", "1/12"))
    for k in range(n + 1):
        lines += _joint(f"a{k}", "ground", f"upright{k}", f"[{k}, 0, 0]")
        lines += ["actuated = true"] if driven and k == 0 else []
    for k in range(n):
        lines += _joint(f"b{k}", f"upright{k}", f"bar{k}", "[0, 1, 0]")
        lines += [*_joint(f"c{k}", f"upright{k + 1}", f"bar{k}", "[0, 1, 0]"), _CHILD]
    return "\n".join(lines) + "\n"


_CHILD = "child_frame = { position = [1, 0, 0] }"


def _link(name: str, com: str, moments: tuple[str, str, str]) -> list[str]:
    xx, yy, zz = (f'"{moment}"' for moment in moments)
    inertia = f"inertia = {{ xx = {xx}, yy = {yy}, zz = {zz} }}"
    return ["", f"[bodies.{name}]", "mass = 1", f"com = {com}", inertia]


def _joint(name: str, parent: str, child: str, position: str) -> list[str]:
    bodies = [f'parent = "{parent}"', f'child = "{child}"']
    frame = f"parent_frame = {{ position = {position} }}"
    return ["", f"[joints.{name}]", 'kind = "R"', *bodies, "axes = [[0, 0, 1]]", frame]
