"""USD files of the package ``newton``, 1.8.0: read, with the matter that Newton's own importer gives."""

from functools import cache
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pytest

from screwgauge import ScrewgaugeError
from support.readings import Reading, read

newton = pytest.importorskip("newton")
pytest.importorskip("newton_usd_schemas")
pytest.importorskip("pxr")

#: Files that are not read, and the reason.
NOT_READ = {
    "test_joint_fixed_unary.usda": "no degree of freedom",
}
#: What Newton's importer is not to do: merge bodies, approximate shapes (which takes a package of its own).
OPTIONS = {"collapse_fixed_joints": False, "load_visual_shapes": False, "skip_mesh_approximation": True}
#: Rounding of 32 bits, of sums of shapes.
SINGLE = 1e-6
#: Body of which the file states nothing, to which Newton gives no mass and OpenUSD 1 kg.
STATED_NOWHERE = ("Anchor",)


def files() -> list[Path]:
    """All files with rigid bodies."""
    folder = Path(str(distribution("newton").locate_file("newton")))
    return [
        file for file in sorted(folder.rglob("*.usda")) if "PhysicsRigidBodyAPI" in file.read_text(encoding="utf-8")
    ]


@cache
def readings() -> dict[Path, Reading | str]:
    found: dict[Path, Reading | str] = {}
    for file in files():
        try:
            found[file] = read(file, "screwgauge")
        except ScrewgaugeError as error:
            found[file] = str(error)
    return found


@pytest.mark.campaign
def test_all_files_are_read_but_those_that_are_named():
    refused = {file.name: said for file, said in readings().items() if isinstance(said, str)}
    assert refused.keys() == NOT_READ.keys()
    assert all(NOT_READ[name] in said for name, said in refused.items())
    assert len(readings()) >= 70


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore")  # what the importer says of files is not what is tested
def test_matter_is_that_of_newtons_own_importer():
    """Whole bodies, as Newton merges none; of bodies that are fixed to each other there is none to compare."""
    compared = 0
    for file, found in readings().items():
        if isinstance(found, str):
            continue
        builder = newton.ModelBuilder()
        numbers = builder.add_usd(str(file), **OPTIONS)["path_body_map"]
        for path, i in numbers.items():
            name = next((n for n in (path.rpartition("/")[2], path[1:].replace("/", ".")) if n in found.bodies), "")
            if not name or name in STATED_NOWHERE or found.bodies[name].parts:
                continue
            body, mass = found.bodies[name], builder.body_mass[i]
            com, inertia = np.array(builder.body_com[i]), np.array(builder.body_inertia[i]).reshape(3, 3)
            assert abs(body.mass - mass) <= SINGLE * mass, path
            assert np.abs(body.com - com).max() <= SINGLE * max(1.0, np.abs(com).max()), path
            assert np.abs(body.inertia - inertia).max() <= SINGLE * np.abs(inertia).max(), path
            compared += 1
    assert compared >= 150
