"""A planar biped in space: a torso that floats, and legs of thigh, shank and foot beside each other."""

from support.data import data

#: Length of thigh and shank, the sole in the frame of a foot, and distance of the legs [m].
LINK, SOLE, STEP = 0.4, (0.05, 0.0, -0.07), 0.2
BASE = ("base.x", "base.y", "base.z", "base.q1", "base.q2", "base.q3")
_TORSO = data("biped-torso.toml")
_LEG = data("biped-leg.toml")


def biped(legs: int = 1) -> str:
    ways = [f"{joint}{k}" for k in range(1, legs + 1) for joint in ("hip", "knee", "ankle")]
    independent = "\n".join(f'"{name}" = "{name}"' for name in (*BASE, *ways))
    parts = [f'name = "biped"\n[independent]\n{independent}\n{_TORSO}']
    for k in range(1, legs + 1):
        numbered = _LEG.replace("K]", f"{k}]").replace('K"', f'{k}"')
        parts.append(numbered.replace("Y", f"{STEP * (k - 1):g}"))
    return "".join(parts)


def gait(leg: int, *, knee: float = 0.4, hip: float = 0.1) -> str:
    """Motion of a leg: its foot stays level where its neighbours move alike."""
    return (
        f"motion.hip{leg} = {{ offset = {-knee / 2}, harmonics = [[3, 0, {hip}]] }}\n"
        f"motion.knee{leg} = {{ offset = {knee}, harmonics = [[4, 0, 0.1]] }}\n"
        f"motion.ankle{leg} = {{ offset = {-knee / 2}, harmonics = [[5, 0, 0.05]] }}\n"
    )


def contact(body: str, kind: str = "weld", more: str = "") -> str:
    point = ", ".join(f"{x:g}" for x in SOLE)
    return f'[[contacts]]\nbody = "{body}"\nkind = "{kind}"\npoint = [{point}]\n{more}\n'
