import pytest

import screwgauge
from screwgauge import load_scene
from support.mechanism import load_mechanism

SUFFIX = {"pinocchio": ".urdf", "mujoco": ".xml", "pinocchio-full": "-full.urdf", "mujoco-full": "-full.xml"}


@pytest.fixture
def own_model(write, paper_scene):
    def make(engine: str, text: str, name: str = "own"):
        write(name, text)
        return paper_scene(models=f'models = {{ {engine} = "{name}" }}')

    return make


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["screw", *SUFFIX])
@pytest.mark.parametrize("text", ["", "not a model", "<robot", "<html></html>", "\0\1", "[1, 2]"])
def test_a_file_that_is_no_model_is_refused(engine, text, own_model, refused):
    said = refused("run", own_model(engine, text, "own.toml" if engine == "screw" else "own"), "--engines", engine)
    assert "own" in said or f"model of {engine}" in said


@pytest.mark.slow
@pytest.mark.parametrize("engine", SUFFIX)
@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ('"leg1.q3"', '"leg1.q33"', "has no joint coordinate 'leg1.q3'"),
        ('"leg3.upper"', '"leg3.other"', "has no body 'leg3.upper'"),
    ],
)
def test_a_renamed_joint_or_body_is_named(engine, old, new, what, own_model, paper_models, refused):
    text = paper_models[f"3ups-upu-s{SUFFIX[engine]}"]
    assert old in text
    said = refused("run", own_model(engine, text.replace(old, new)), "--engines", engine)
    assert what in said or "cannot load" in said


@pytest.mark.parametrize("engine", ["pinocchio", "pinocchio-full"])
def test_what_the_urdf_parser_only_prints_is_refused(engine, own_model, paper_models, refused):
    text = paper_models[f"3ups-upu-s{SUFFIX[engine]}"].replace('mass value="2.87"', 'mass value="heavy"')
    if "heavy" not in text:  # the full cut shares the platform among the chain ends
        text = text.replace('mass value="', 'mass value="heavy', 1)
    said = refused("run", own_model(engine, text), "--engines", engine)
    assert "own: Pinocchio cannot load the file (" in said
    assert "heavy" in said


def test_a_mjcf_without_its_closures_is_refused(own_model, paper_models, refused):
    text = paper_models["3ups-upu-s.xml"]
    begin, end = text.index("<equality>"), text.index("</equality>") + len("</equality>")
    said = refused("run", own_model("mujoco", text[:begin] + text[end:]), "--engines", "mujoco")
    assert "mujoco: has no closure" in said


def test_the_generated_files_themselves_are_accepted(write, paper_scene, paper_models):
    for engine, suffix in SUFFIX.items():
        write(f"{engine}{suffix}", paper_models[f"3ups-upu-s{suffix}"])
    lines = ", ".join(f'{engine} = "{engine}{suffix}"' for engine, suffix in SUFFIX.items())
    scene = load_scene(paper_scene(models=f"models = {{ {lines} }}"))
    assert screwgauge.run(scene, engines=["screw", *SUFFIX], quantities=["actuator_force"]).exit_status == 0


def test_a_model_that_does_not_close_is_a_failed_engine_and_no_bad_input(own_model):
    lengthened = 'extends = "3ups-upu-s"\nname = "own"\njoints."leg1.wrist".child_frame.position = [2.5, 0, 5]\n'
    results = screwgauge.run(load_scene(own_model("screw", lengthened, "own.toml")), quantities=["joint_position"])
    assert results.exit_status in (1, 3)


def test_the_mechanism_of_the_scene_stays_what_it_was(own_model, paper):
    scene = load_scene(own_model("screw", 'extends = "3ups-upu-s"\nname = "own"\n', "own.toml"))
    assert scene.mechanism.name == paper.name == load_mechanism("3ups-upu-s").name
