import numpy as np
import pytest

import screwgauge
from screwgauge.truth import cache
from support.truth import notes, samples

QUANTITIES = ["joint_position", "joint_velocity"]

pytestmark = pytest.mark.usefixtures("cache_folder")


@pytest.fixture
def calls(monkeypatch):
    """Counts computed samples."""
    found, sample = [], samples.Sampler.sample

    def counted(self, *given):
        found.append(1)
        return sample(self, *given)

    monkeypatch.setattr(samples.Sampler, "sample", counted)
    return found


def solve(times=(0.1, 0.2), name="3ups-upu-s", quantities=QUANTITIES):
    results = screwgauge.run(screwgauge.load_scene(name).at(times), engines=["truth"], quantities=quantities)
    assert not results.failures, results.failures
    return results


def test_second_run_computes_nothing_and_gives_the_same(calls):
    first, second = solve(), solve()
    assert len(calls) == 2
    for quantity in QUANTITIES:
        assert np.array_equal(first.values(quantity), second.values(quantity))
        assert np.array_equal(first.radius(quantity), second.radius(quantity))
    assert "from the cache" in second.solutions["truth"].timings[0].setting
    assert "anew" not in notes(second)


@pytest.mark.slow
@pytest.mark.parametrize(
    "other",
    [
        {"times": (0.1, 0.25)},
        {"name": "3ups-upu-s-table2-scene"},
        {"quantities": ["joint_position"]},
    ],
)
def test_other_input_is_computed(calls, other, write):
    scene = "mechanism = '3ups-upu-s-table2'\nmotion = { a = {}, b = {} }\ntime = { times = [0] }\n"
    if "name" in other:
        other = {"name": write("t.toml", scene)}
    solve()
    solve(**other)
    assert len(calls) == 4


def test_another_gravity_is_another_question(calls):
    scene = screwgauge.load_scene("3ups-upu-s").at([0.1])
    moon, mars = (
        screwgauge.run(scene.under(gravity=np.array([0.0, 0.0, g])), ["truth"], ["generalized_force"])
        for g in (-1.62, -3.71)
    )
    assert len(calls) == 2
    assert not np.allclose(moon.values("generalized_force"), mars.values("generalized_force"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda data: data[:-10], "damaged"),
        (lambda data: b"", "damaged"),
        (lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:], "damaged"),
        (lambda data: data.replace(data.split(b" ")[1], b"0" * 64, 1), "a different version"),
    ],
)
def test_damaged_or_stale_file_is_computed_anew_and_said_so(calls, cache_folder, damage, said):
    solve()
    (file,) = (path for path in cache_folder.iterdir() if path.name != cache.SECRET)
    file.write_bytes(damage(file.read_bytes()))
    again = solve()
    assert len(calls) == 4
    assert said in notes(again)
    assert "recomputed" in notes(again)
    assert "anew" not in notes(solve())  # mended
    assert len(calls) == 4


WRONG = (
    lambda arrays: arrays.clear(),
    lambda arrays: arrays.pop("stages"),
    lambda arrays: arrays.pop("mid.joint_velocity"),
    lambda arrays: arrays.pop("radius.joint_position"),
    lambda arrays: arrays.update(reasons=np.array(["one too many"])),
    lambda arrays: arrays.update(seconds=np.array(["a"] * len(arrays["seconds"]))),
    lambda arrays: arrays.update({"mid.nothing": np.zeros(2), "radius.nothing": np.zeros(2)}),
    lambda arrays: arrays.update({"mid.joint_velocity": arrays["mid.joint_velocity"][:0]}),
    lambda arrays: arrays.update({"mid.joint_velocity": arrays["mid.joint_velocity"] * np.nan}),
    lambda arrays: arrays.update({"mid.joint_position": arrays["mid.joint_position"] + 1e-3}),
    lambda arrays: arrays.update({"radius.joint_position": -1.0 - arrays["radius.joint_position"]}),
    lambda arrays: arrays.update({"radius.joint_position": arrays["radius.joint_position"].astype(str)}),
)


@pytest.mark.slow
def test_another_payload_with_its_own_hash_is_computed_anew_and_said_so(calls, cache_folder):
    first = solve([0.1])
    (file,) = (path for path in cache_folder.iterdir() if path.name != cache.SECRET)
    version = file.read_bytes().split(b" ")[1].decode()
    right = cache.read(file.name, version)[0]
    for count, change in enumerate(WRONG, 2):
        arrays = dict(right)
        change(arrays)
        assert cache.write(file.name, version, arrays) == ""
        again = solve([0.1])
        assert (len(calls), "damaged" in notes(again)) == (count, True)
        assert np.array_equal(first.values("joint_position"), again.values("joint_position"))
    assert "anew" not in notes(solve([0.1]))


@pytest.mark.parametrize("payload", [b"", b"PK\x05\x06", b"PK\x03\x04" + bytes(40), b"\x93NUMPY", b"x" * 100])
def test_a_payload_that_is_no_archive_is_damaged(payload, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(np, "savez_compressed", lambda stream, **arrays: stream.write(payload))
        assert cache.write("key", "version", {}) == ""
    assert cache.read("key", "version") == (None, cache.DAMAGED)


def test_folder_that_cannot_be_used_costs_only_a_sentence(cache_folder, calls):
    cache_folder.write_text("a file")
    assert "the cache cannot be" in notes(solve())
    assert len(calls) == 2


def test_folder_is_found_by_the_environment(monkeypatch, tmp_path):
    assert cache.folder() == tmp_path / "cache"
    monkeypatch.delenv(cache.VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache.folder() == tmp_path / "screwgauge" / "truth"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache.folder().parts[-3:] == (".cache", "screwgauge", "truth")


def test_code_in_folders_of_folders_and_packages_are_part_of_a_version(tmp_path):
    (tmp_path / "inner").mkdir()
    file = tmp_path / "inner" / "code.py"
    versions = []
    for text in ("a = 1", "a = 2"):
        file.write_text(text, encoding="utf-8")
        versions += [cache.code_version(tmp_path), cache.code_version(tmp_path, packages=["numpy"])]
    assert len({*versions}) == 4
