import os

import pytest

from screwgauge import ScrewgaugeError
from screwgauge.study import isolation, loading
from support.errors import LoaderError, ModelFileError

pytestmark = pytest.mark.slow

REAL = isolation.run_isolated
INERTIAL = '<inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>'
ROOTS = "".join(f'<body name="{name}"><joint name="{name}j"/>{INERTIAL}</body>' for name in "abc")
MATTER = '<inertial><mass value="1"/><inertia ixx="5" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
HINGE = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>'
ARM = f'<robot name="r"><link name="a"/><link name="b">{MATTER}</link>{HINGE}</robot>'


@pytest.mark.slow
def test_a_crash_costs_one_reading(write, monkeypatch):
    roots, read = write("roots.xml", f"<mujoco><worldbody>{ROOTS}</worldbody></mujoco>"), loading.read

    def crashing(path, library, **more):  # goes to its process by value, being of no module
        return os.abort() if library == "pinocchio" else read(path, library, **more)

    monkeypatch.setattr(isolation, "run_isolated", REAL)
    monkeypatch.setattr(loading, "read", crashing)
    with pytest.raises(LoaderError, match=r"pinocchio .*crashed.* SIGABRT"):
        loading.read_isolated(roots, "pinocchio")
    assert list(loading.read_isolated(roots, "mujoco").bodies) == ["a", "b", "c"]


@pytest.mark.slow
def test_a_reading_that_takes_all_memory_ends_and_names_no_option_of_engines(write, monkeypatch):
    def greedy(path, *rest, **more):
        return len(bytearray(4_500_000_000))  # never touched: that it may be had is enough

    monkeypatch.setattr(isolation, "run_isolated", REAL)
    monkeypatch.setattr(loading, "read", greedy)
    monkeypatch.setattr(loading, "import_model", greedy)
    path = write("roots.xml", f"<mujoco><worldbody>{ROOTS}</worldbody></mujoco>")
    for load in (lambda: loading.read_isolated(path, "mujoco"), lambda: loading.import_isolated(path)):
        with pytest.raises(ScrewgaugeError, match="limit of 4 GB") as refusal:
            load()
        assert "--memory" not in str(refusal.value)


@pytest.mark.slow
def test_a_refusal_has_its_reason(write, monkeypatch):
    path = write("arm.urdf", ARM)
    monkeypatch.setattr(isolation, "run_isolated", REAL)
    with pytest.raises(ModelFileError, match=r"MuJoCo refuses it \("):
        loading.read_isolated(path, "mujoco")
    assert list(loading.read_isolated(path, "pinocchio").bodies) == ["b"]
