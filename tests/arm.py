"""An arm of seven joints as URDF and as MJCF, written from the same numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

AXES = ("0 0 1", "0 1 0", "0 0 1", "0 -1 0", "0 0 1", "1 0 0", "0 0 1")
#: The last but one slides.
SLIDES = (5,)


def write(folder: Path, *, seed: int = 7, gravity: str = "0 0 -9.81", name: str = "arm") -> tuple[Path, Path]:
    """Writes both files; no number is special, and no axis of a joint is a principal one of a body."""
    random = np.random.default_rng(seed)
    urdf, mjcf, end = ['<link name="base"/>'], [], []
    for i, axis in enumerate(AXES):
        p, r, c = (random.uniform(-0.3, 0.3, 3).round(4) for _ in range(3))
        mass, kind = round(random.uniform(0.5, 3.0), 4), "slide" if i in SLIDES else "hinge"
        damping, friction, low, high = 0.1 + i / 100, 0.02 + i / 1000, round(-1.5 - i / 10, 3), round(1.2 + i / 10, 3)
        R = np.linalg.qr(random.normal(size=(3, 3)))[0]
        I = (R @ np.diag(mass * np.array([0.011, 0.017, 0.021])) @ R.T).round(8)
        xyz, rpy, com = (" ".join(map(str, v)) for v in (p, r, c))
        entries = {k: I["xyz".index(k[0]), "xyz".index(k[1])] for k in ("xx", "yy", "zz", "xy", "xz", "yz")}
        tensor = " ".join(f'i{k}="{v}"' for k, v in entries.items())
        urdf.append(
            f'<link name="link{i}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia {tensor}/></inertial>'
            f'</link><joint name="joint{i}" type="{"prismatic" if kind == "slide" else "revolute"}">'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><parent link="{f"link{i - 1}" if i else "base"}"/>'
            f'<child link="link{i}"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" effort="1" velocity="1"/>'
            f'<dynamics damping="{damping}" friction="{friction}"/></joint>'
        )
        mjcf.append(
            f'<body name="link{i}" pos="{xyz}" euler="{rpy}"><inertial pos="{com}" mass="{mass}" '
            f'fullinertia="{" ".join(str(v) for v in entries.values())}"/><joint name="joint{i}" type="{kind}" '
            f'axis="{axis}" range="{low} {high}" damping="{damping}" frictionloss="{friction}"/>'
        )
        end.append("</body>")
    paths = folder / f"{name}.urdf", folder / f"{name}.xml"
    paths[0].write_text(f'<robot name="{name}">{"".join(urdf)}</robot>', encoding="utf-8")
    paths[1].write_text(
        f'<mujoco model="{name}"><compiler angle="radian" eulerseq="XYZ" autolimits="true"/>'
        f'<option gravity="{gravity}"/><worldbody><body name="base">{"".join(mjcf)}{"".join(end)}</body></worldbody>'
        "</mujoco>",
        encoding="utf-8",
    )
    return paths


def edited(path: Path, old: str, new: str, name: str) -> Path:
    """A copy with a text replaced that is there once."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{old} is {text.count(old)} times in {path.name}"
    copy = path.with_name(name)
    copy.write_text(text.replace(old, new), encoding="utf-8")
    return copy
