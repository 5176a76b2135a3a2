"""MuJoCo's compiler on texts, its warnings and refusals in words."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from screwgauge.reference.errors import ModelFileError

#: What MuJoCo says of a file that others may take -> what to do.
_REMEDIES = {
    "larger than mjMINVAL": "give that link a share of its neighbour's mass (1e-6 of it), or let Pinocchio read it",
    "positive eigenvalues": "give that link a tensor with three positive principal moments, or let Pinocchio read it",
    "A + B >= C": "give that link the tensor of a body that can be, or let Pinocchio read it",
    "top level": "let Pinocchio read it: MuJoCo lets only bodies of the world float",
}


def compiled(
    text: str, where: str, models: Mapping[str, str] | None = None, meshes: Mapping[str, bytes] | None = None
) -> Any:
    """The compiled model; bodies that are fixed to each other stay apart. No file is opened.

    Args:
        where: The file to blame.
        models: File that the text names -> text of the model that it attaches.
        meshes: File that the text names -> what is in it.

    Raises:
        ModelFileError: MuJoCo refuses it.
    """
    import mujoco

    attached = {name: model.encode() for name, model in (models or {}).items()}
    try:
        spec = mujoco.MjSpec.from_string(text, include=attached or None, assets=dict(meshes or {}) or None)
        spec.compiler.fusestatic = False  # bodies keep their names; MuJoCo 4.0.0 merges those of a URDF alike
        _name_joints(spec)
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        said = " ".join(str(error).removeprefix("Error: ").split())
        remedy = next((remedy for sign, remedy in _REMEDIES.items() if sign in said), "mend the file")
        raise ModelFileError(f"MuJoCo refuses it ({said})", where, remedy) from None


def _name_joints(spec: Any) -> None:
    """Names those that MuJoCo itself makes of a composite or flex, as those of a file are named."""
    taken = {joint.name for joint in spec.joints}
    for joint in [joint for joint in spec.joints if not joint.name]:
        name = f"{joint.parent.name}_joint"
        k = 1
        while (wanted := f"{name}_{k}" if k > 1 else name) in taken:
            k += 1
        joint.name = wanted
        taken.add(wanted)


@contextmanager
def warned() -> Iterator[list[str]]:
    """MuJoCo's warnings as a list: its own handler writes MUJOCO_LOG.TXT into the working directory."""
    import mujoco

    said: list[str] = []
    mujoco.set_mju_user_warning(said.append)
    try:
        yield said
    finally:
        mujoco.set_mju_user_warning(None)


@contextmanager
def heard() -> Iterator[list[str]]:
    """What MuJoCo and its Python package warn of, as phrases, known after it."""
    phrases: list[str] = []
    with warned() as said, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield phrases
    phrases += [f"what MuJoCo warns of: {text}" for text in (*said, *(warning.message for warning in caught))]
