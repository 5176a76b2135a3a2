"""Scenes, their tasks and quantities."""

from pathlib import Path

from screwgauge import Scene, load_scene
from screwgauge.models.home import check_home
from screwgauge.problem import GivenMotion, InitialValue, Integration, States
from screwgauge.quantities import BODY_UNITS, FLOOR, GIVEN, RATE, SIMULATED, SOLVED, digits, natural_scales
from screwgauge.quantities import QUANTITIES as TABLE
from screwgauge.scene.assumed import assumptions
from screwgauge.scene.motion import read_columns
from screwgauge.scene.observables import observe
from screwgauge.scene.preflight import check_actuation, check_scene, doubts, far_from_home
from screwgauge.scene.read import FOLDER, scene_names
from screwgauge.scene.simulation import check_start, eigenvalues
from screwgauge.study.reference_values import QUANTITIES, pose_scene


def sampled(name: str | Path, rows: slice | list[int]) -> Scene:
    scene = load_scene(name)
    return scene.at(scene.t[rows])
