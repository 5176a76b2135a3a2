"""A repository of somebody's with a four-bar, its model files and scenes, for tests of the gate."""

from collections.abc import Callable
from pathlib import Path

from screwgauge.models.catalog import load_mechanism
from screwgauge.models.generate import write_models
from support.bad_works import hang, segfault
from support.planar import Bar, four_bar

SCENE = """mechanism = "four-bar.toml"
motion.crank = {{ offset = 1.0, harmonics = [[20, 0.2, 0.1]] }}
time = {{ times = [0, 0.25, 0.5] }}
engines = ["screw", "mujoco"]
quantities = {quantities}
{more}
"""
FORCES = '["joint_position", "actuator_force"]'


def scene(more: str = "", quantities: str = FORCES) -> str:
    return SCENE.format(more=more, quantities=quantities)


def repository(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    centres = (0.1123456789012, 0.2534567890123, 0.1712345678901)
    sizes = zip((0.3, 0.6, 0.4), (0.5, 1.2, 0.9), centres, strict=True)
    bars = [Bar(length, mass, (x, 0.0, 0.1 * x)) for length, mass, x in sizes]
    text = 'name = "four-bar"\nindependent.crank = "a"\n' + four_bar(bars, 0.5, 1.0)
    (folder / "four-bar.toml").write_text(text, encoding="utf-8")
    write_models(load_mechanism(folder / "four-bar.toml"), folder)
    (folder / "turn.toml").write_text(scene('models.mujoco = "four-bar.xml"'), encoding="utf-8")
    return folder


def edited(file: Path, change: Callable[[str], str]) -> str:
    text = file.read_text(encoding="utf-8")
    new = change(text)
    assert new != text
    file.write_text(new, encoding="utf-8")
    return text


def worse(text: str, by: float) -> str:
    value = 1.2 * 0.02 * 1.2
    (written,) = {word for word in text.split() if word.startswith("0.0288")}
    assert abs(float(written) / value - 1.0) < 1e-15
    return text.replace(written, repr(value * (1.0 + by)))


def tell(results: object) -> str:
    name = results.scene.name
    for work in (segfault, hang):
        if name == work.__name__:
            work(lambda share: None)
    return f"told of {name}"
