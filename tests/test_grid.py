import json

import numpy as np
import pytest

import screwgauge
from screwgauge.cli import main
from screwgauge.report.figures.contour import lines
from screwgauge.report.figures.drawings import unmatched_figures
from support.data import data
from support.errors import DescriptionError
from support.judging import agreed

#: Side -> where its crank is above the ankle, and how long its rod is [m].
SIDES = {"left": (0.03, 0.20), "right": (-0.03, 0.28)}
MAP = data("torque-map.toml")
FIGURE = '[[figures]]\ntitle = "Map"\nquantity = "jacobian"\ncontour = "toe.vz/left"\n'


@pytest.fixture
def ankle(write):
    write("ankle.toml", data("ankle.toml"))

    def read(size: float, count: int, more: str = ""):
        return screwgauge.load_scene(write("map.toml", MAP.format(size=size, count=count) + more))

    return read


def foot(pitch, roll, place) -> np.ndarray:
    x, y, z = place
    y, z = y * np.cos(roll) - z * np.sin(roll), y * np.sin(roll) + z * np.cos(roll)
    return np.stack([x * np.cos(pitch) + z * np.sin(pitch), y + 0.0 * x, z * np.cos(pitch) - x * np.sin(pitch)], axis=1)


def cranks(pitch, roll) -> np.ndarray:
    angles = []
    for y, h in SIDES.values():
        heel = foot(pitch, roll, (-0.05, y, 0.0)) - [0.0, y, h]
        # |heel - r (-cos a, 0, sin a)| = h
        A, B = 0.1 * heel[:, 0], -0.1 * heel[:, 2]
        C = h * h - (heel**2).sum(axis=1) - 0.05**2
        with np.errstate(invalid="ignore"):
            angles.append(np.arctan2(B, A) - np.arccos(C / np.hypot(A, B)))
    return np.stack(angles, axis=1)


def beside(cells: np.ndarray) -> np.ndarray:
    wide = np.pad(cells, 1)
    return wide[2:, 1:-1] | wide[:-2, 1:-1] | wide[1:-1, 2:] | wide[1:-1, :-2]


def test_cells_without_numbers_are_those_that_rods_do_not_reach(ankle):
    scene = ankle(1.5, 31)
    pitch, roll = (each.ravel() for each in np.meshgrid(*scene.grid.axes, indexing="ij"))
    reached = np.isfinite(cranks(pitch, roll)).all(axis=1).reshape(31, 31)
    found = np.zeros((31, 31), dtype=bool)
    found[tuple(scene.grid.cells.T)] = True
    assert 0 < found.sum() < found.size
    assert not (found & ~reached).any()
    lost = reached & ~found  # on the far side of what is not reached
    assert not (lost & beside(found)).any()
    named = {one.cell for one in scene.grid.missing}
    assert named == {*map(tuple, np.argwhere(~found).tolist())}
    assert all(one.reason and "pitch" in one.pose for one in scene.grid.missing)


def test_the_map_has_the_rates_of_the_closed_form_and_engines_agree(ankle):
    scene = ankle(1.2, 9)
    results = agreed(screwgauge.run(scene, ["screw", "pinocchio", "mujoco", "lagrange"]))
    values = results.solutions["screw"].values["jacobian"]
    pitch, roll = scene.motion.y.T
    h, rates, moved = 1e-6, [], []
    for dp, dr in ((h, 0.0), (0.0, h)):
        ends = [(pitch + sign * dp, roll + sign * dr) for sign in (1, -1)]
        angles, toes = [cranks(*end) for end in ends], [foot(*end, (0.15, 0.0, -0.08)) for end in ends]
        rates.append((angles[0] - angles[1]) / (2 * h))
        moved.append((toes[0] - toes[1]) / (2 * h))
    J = np.stack(moved, axis=2) @ np.linalg.inv(np.stack(rates, axis=2))
    for k, axis in enumerate("xyz"):
        for i, side in enumerate(SIDES):
            found = values.array[:, values.components.index(f"toe.v{axis}/{side}")]
            assert np.abs(np.abs(found) - np.abs(J[:, k, i])).max() < 1e-6 * np.abs(J).max()


def test_the_walk_goes_from_cell_to_cell_and_rests_at_each(ankle):
    scene = ankle(1.5, 15)
    grid, motion = scene.grid, scene.motion
    assert not np.concatenate([motion.yd, motion.ydd]).any()
    hops = np.abs(np.diff(grid.path, axis=0)) / [grid.axes[0][1] - grid.axes[0][0]] * 2
    assert ((hops > 1e-9).sum(axis=1) == 1).all()
    pitch, roll = grid.axes
    assert motion.y == pytest.approx(np.stack([pitch[grid.cells[:, 0]], roll[grid.cells[:, 1]]], axis=1))
    t = np.linspace(0.0, len(grid.cells) - 1.0, 4001)[1:-1] + 1e-7
    step = 1e-5
    ahead, behind, now = (grid(t + shift) for shift in (step, -step, 0.0))
    assert np.abs((ahead.y - behind.y) / (2 * step) - now.yd).max() < 1e-3 * np.abs(now.yd).max()


def test_rods_on_two_balls_spin_freely_and_give_the_same_map(ankle, write):
    scene = ankle(0.4, 4)
    right = agreed(screwgauge.run(scene, ["screw"])).solutions["screw"]
    text, universal = scene.mechanism_file.read_text(encoding="utf-8"), "axes = [[0, 1, 0], [1, 0, 0]]\nparent_frame"
    for side in SIDES:
        joint = f'[joints."{side}.elbow"]\nkind = "U"\nparent = "{side}.crank"\nchild = "{side}.rod"\n'
        text = text.replace(f"{joint}{universal}", f"{joint.replace('U', 'S')}parent_frame")
        text = text.replace("[independent]", f'[independent]\n{side} = "{side}.elbow.q3"')
    write(scene.mechanism_file.name, text)
    results = agreed(screwgauge.run(screwgauge.load_scene(scene.file), ["screw", "pinocchio", "mujoco", "lagrange"]))
    assert [one.label for one in results.scene.undriven] == ["right", "left"]
    for name, values in right.values.items():
        names = [component for component in values.components if ".rod." not in component]
        expected, found = (one.pick(names).array for one in (values, results.solutions["pinocchio"].values[name]))
        assert found == pytest.approx(expected, rel=0, abs=1e-12 * np.abs(expected).max()), name


def test_singular_cells_are_named_and_those_beside_have_numbers(write):
    text = (
        screwgauge.load_scene("slider-crank").mechanism_file.read_text(encoding="utf-8").replace("actuated = true", "")
    )
    write("slider.toml", text.replace("home = [0.4]", "home = [0.4]\nactuated = true"))
    grid = "[motion.grid]\ncrank = { from = -1, to = 1, count = 21 }\n"
    scene = screwgauge.load_scene(write("s.toml", f'mechanism = "slider.toml"\nquantities = ["jacobian"]\n{grid}'))
    (lost,) = scene.grid.missing
    assert lost.cell == (10,)
    assert "singular" in lost.reason
    assert len(scene.t) == 20
    agreed(screwgauge.run(scene))


def test_cells_beyond_limits_are_named(write, ankle):
    file, frame = ankle(0.4, 3).mechanism_file, "parent_frame = { position = [0, 0.03, 0.2] }"
    write(file.name, file.read_text(encoding="utf-8").replace(frame, f"limits = [[-0.2, 0.2]]\n{frame}"))
    scene = screwgauge.load_scene(write("map.toml", MAP.format(size=0.4, count=5)))
    assert {one.reason.partition(" is ")[0] for one in scene.grid.missing} == {"'left.motor'"}
    agreed(screwgauge.run(scene, ["screw", "mujoco"]))


def test_a_grid_may_have_any_number_of_coordinates(write):
    axes = "\n".join(f"{label} = {{ from = -0.2, to = 0.3, count = 3 }}" for label in ("q1", "q2", "q3"))
    scene = screwgauge.load_scene(
        write("s.toml", f'mechanism = "delta"\nquantities = ["actuator_force"]\n[motion.grid]\n{axes}\n')
    )
    assert len(scene.t) == 27
    agreed(screwgauge.run(scene))
    line = "[motion]\nq2 = { offset = 0.1 }\n[motion.grid]\nq1 = { from = 0, to = 0.3, count = 4 }\n"
    scene = screwgauge.load_scene(write("s.toml", f'mechanism = "delta"\n{line}'))
    assert scene.motion.y[:, 1:] == pytest.approx(np.tile([0.1, 0.0], (4, 1)))


def test_a_grid_without_a_cell_is_refused(ankle):
    with pytest.raises(DescriptionError, match="no cell has values"):
        ankle(1.5, 2)


def test_one_command_draws_the_map_and_names_every_cell(ankle, tmp_path, capsys):
    scene = ankle(1.5, 9, FIGURE)
    assert main(["run", str(scene.file), "--engines", "screw", "--out", str(tmp_path / "out"), "--json"]) == 0
    out = capsys.readouterr().out
    summary = json.loads(out)
    assert any("cells of the grid" in sentence for sentence in summary["warnings"])
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert all(one.pose in text for one in scene.grid.missing)
    (picture,) = (tmp_path / "out" / "plots").glob("01-map*.svg")
    drawn = picture.read_text(encoding="utf-8")
    assert "toe.vz/left" in drawn
    assert drawn.count("#d0d0d0") >= len(scene.grid.missing)
    results = screwgauge.run(scene, ["screw"])
    results.figure("01-map").save(tmp_path / "map.svg", width="8cm")
    assert "toe.vz/left" in (tmp_path / "map.svg").read_text(encoding="utf-8")


def test_a_component_that_is_not_there_is_named(ankle):
    scene = ankle(0.3, 3, FIGURE.replace("toe", "heel"))
    (sentence,) = unmatched_figures(scene.figures, screwgauge.run(scene, ["screw"]).solutions)
    assert "heel.vz/left" in sentence


def test_lines_of_a_plane_are_straight_and_stop_where_there_are_no_numbers():
    x, y = np.linspace(0.0, 1.0, 5), np.linspace(0.0, 2.0, 7)
    table = x[:, None] + y
    table[2, 3] = np.nan
    pieces = [*lines(x, y, table, np.array([0.7, 1.9]))]
    assert pieces
    for a, b, c, d in pieces:
        level = 0.7 if a + b < 1.3 else 1.9
        assert (a + b, c + d) == pytest.approx((level, level), abs=1e-5, rel=0)
        assert not (0.25 < 0.5 * (a + c) < 0.75 and 2 / 3 < 0.5 * (b + d) < 4 / 3)


def test_lines_pass_a_saddle_between_corners_that_are_alike():
    x = np.array([0.0, 1.0])
    for corner, joined in ((1.0, True), (0.15, False)):  # on one side of the level with the middle, or not
        table = np.array([[corner, 0.0], [0.0, corner]])
        pieces = [*lines(x, x, table, np.array([0.1]))]
        assert [abs(a + c - b - d) > 1.0 for a, b, c, d in pieces] == [joined, joined]
