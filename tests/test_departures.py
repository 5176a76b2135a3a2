import re
from dataclasses import replace
from importlib.metadata import EntryPoint
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest

import screwgauge
from screwgauge.models.content import FORMATS, extras
from screwgauge.study.mismatches import departures, left_out_of_file
from support.claims import filled, table
from support.data import DATA, data
from support.engines import ENGINES, ModelFiles, get_engine, registry
from support.errors import ModelFileError
from support.facts import replaced
from support.judging import reference_values
from support.mechanism import load_mechanism, mechanism_names, mechanism_path
from support.models import CUTS, model_texts, stem
from support.pages import markdown
from support.report import conclusion, phrase, report, summary, verdict

SUFFIX = {"pinocchio": "urdf", "mujoco": "xml"}
WRITTEN = {ending: FORMATS[ending] for ending in (".urdf", ".xml")}
TABLE = table("departures")
EDITS = [
    pytest.param(engine, kind, *edit, id=f"{engine}: {name}")
    for engine, suffix in SUFFIX.items()
    for kind in (suffix, "loops.toml")
    for name, edit in TABLE[kind].items()
]
_AXIS = TABLE["urdf"]["damping"][0]
_B, FLAGS = (TABLE["xml"][name][0] for name in ("armature", "friction switched off"))
TENDON = TABLE["xml"]["tendon"][1]
POINTS = "child_points = [[0.6, 0, 0.3], [0.6, 0, -0.3]]", "child_points = [[0.601, 0, 0.3], [0.601, 0, -0.3]]"


@pytest.fixture(scope="module")
def scene():
    """A four-bar, two samples."""
    return screwgauge.load_scene(DATA / "four-bar-scene.toml").at([0.0, 0.2])


@pytest.fixture(scope="module")
def texts(scene):
    return model_texts(scene.mechanism, gravity=scene.applied.g)


@pytest.fixture
def own(write, texts):
    def make(engine: str, kind: str, old: str, new: str) -> ModelFiles:
        write("more.xml", '<mujoco><default><joint armature="1"/></default></mujoco>')
        files = {suffix: texts[f"four-bar.{suffix}"] for suffix in (SUFFIX[engine], "loops.toml")}
        assert old in files[kind]
        files[kind] = files[kind].replace(old, new.replace("&", old), 1)
        return ModelFiles(*(write(f"own.{suffix}", text) for suffix, text in files.items()))

    return make


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "kind", "old", "new", "becomes"), EDITS)
def test_no_edit_is_silent(engine, kind, old, new, becomes, own, scene):
    files = own(engine, kind, old, new)
    if becomes == "refused":
        with pytest.raises(ModelFileError):
            get_engine(engine).load(files)
        return
    get_engine(engine).load(files)
    if becomes == "refused by name":
        with pytest.raises(ModelFileError):
            left_out_of_file(scene, get_engine(engine), files.model)
        return
    said = departures(scene, engine, files)
    assert bool(left_out_of_file(scene, get_engine(engine), files.model)) == (
        becomes == "measured" or "tendon" in becomes
    )
    if becomes in ("", "measured"):
        assert said == ()
        return
    fate, _, what = becomes.partition(": ")
    fate = {"pinocchio": "other", "mujoco": "unread"}[engine] if fate == "loop" else fate
    begin = re.escape(TABLE["fates"][fate].format(engine=engine, kind=kind))
    assert any(re.match(rf"{begin}(.*, )?{re.escape(what)}(,| and|$)", sentence) for sentence in said), said


def test_a_loops_file_that_makes_an_engine_differ_is_named_in_the_verdict(own, scene):
    mine = replace(scene, models={"pinocchio": own("pinocchio", "loops.toml", *POINTS).model})
    results = screwgauge.run(mine, ["screw", "pinocchio"], ["joint_position"])
    found = verdict(results)
    assert found.word == "✗ DIFFER"
    assert "own.loops.toml, unlike the description: closure points" in found.text
    assert "The models also differ: " in conclusion(results)[0].text  # before any plot of a page


def test_what_urdf_readers_let_pass_as_xml_is_said(own, scene):
    files = own("pinocchio", "urdf", "</robot>", "<undeclared:pull/>&")
    get_engine("pinocchio").load(files)
    (said,) = departures(scene, "pinocchio", files)
    assert re.match(r"own\.urdf cannot be searched .* \(unbound prefix: ", said)


def test_long_chains_are_searched_to_their_end(scene, write):
    n = 5000
    chain = "".join(f'<body name="b{i}"><joint damping="1"/>' for i in range(n)) + "</body>" * n
    found = extras(write("own.xml", f"<mujoco><worldbody>{chain}</worldbody></mujoco>"), "mjcf", scene.mechanism)
    assert [extra.whose for extra in found] == [f" of body b{i}" for i in range(n)]


@pytest.mark.slow
@pytest.mark.parametrize("mechanism", mechanism_names())
@pytest.mark.parametrize("cut", CUTS)
def test_generated_files_say_nothing_beyond_the_description(mechanism, cut):
    described = load_mechanism(mechanism)
    for ending, form in WRITTEN.items():
        path = mechanism_path(mechanism).with_name(f"{stem(mechanism, cut)}{ending}")
        assert extras(path, form, described) == []


def test_limits_of_the_description_bars_and_sensors_are_nothing_beyond_it_but_contacts_are(scene, write):
    joints = [replace(joint, limits=np.array([[-1.5, 4.0]])) for joint in scene.mechanism.joints]
    mechanism = replace(scene.mechanism, joints=tuple(joints))
    for part, kinds in ({"limits", "geoms", "sensors"}, set()), ({"contacts"}, {"applied"}):
        texts = model_texts(mechanism, include=part)
        found = {
            (ending, extra.kind)
            for ending, form in WRITTEN.items()
            for extra in extras(write(f"own{ending}", texts[f"four-bar{ending}"]), form, mechanism)
        }
        assert found == {(".xml", kind) for kind in kinds}


def test_the_table_knows_all_that_mujoco_reads(scene, tmp_path):
    rows = [
        (len(line) - len(line.lstrip()), line.split())
        for line in mujoco.mj_printSchema(False, False).splitlines()
        if line.strip()
    ]
    path, above = tmp_path / "all.xml", list[tuple[int, ET.Element]]()
    for indent, words in rows:
        if indent > 20:  # further attributes of the element above
            names, element = words, above[-1][1]
        else:
            while above and above[-1][0] >= indent:
                above.pop()
            tag, names = words[0].replace("(world)", ""), words[2:]
            element = ET.SubElement(above[-1][1], tag) if above else ET.Element(tag)
            above.append((indent, element))
        element.attrib |= dict.fromkeys(names, "said")
    ET.ElementTree(above[0][1]).write(path)
    found = extras(path, "mjcf", scene.mechanism)
    assert len(found) > 50
    assert [extra for extra in found if extra.kind == "unknown"] == []


@pytest.mark.parametrize("row", TABLE["told"])
def test_departures_are_told_in_one_sentence(row, scene, texts, write, monkeypatch):
    entry = EntryPoint("other", "elsewhere:ENGINE", registry.GROUP)
    monkeypatch.setattr(registry, "further_entries", lambda: {"other": entry})
    monkeypatch.setattr(registry, "_load_description", lambda entry: replace(ENGINES["mujoco"], name="other"))
    cut = "-full" * row["engine"].endswith("-full")
    own = data("four-bar.toml") if row["kind"] == "toml" else ""
    text = filled(replaced(own or texts[f"four-bar{cut}.{row['kind']}"], row["edits"]), {})
    model = write(f"own.{row['kind']}", text)
    files = ModelFiles(model) if own else ModelFiles(model, write("own.loops.toml", texts[f"four-bar{cut}.loops.toml"]))
    assert departures(scene, row["engine"], files) == tuple(filled(each, {}) for each in row["said"])


def test_a_reference_goes_by_the_description_whatever_the_solver_reads(scene, write):
    text = data("four-bar.toml").replace("mass = 1.1", "mass = 2.2")
    one, other = (
        reference_values(replace(scene, models=models), scene.t, ["actuator_force"]).values["actuator_force"].array
        for models in ({}, {"screw": write("own.toml", text), "truth": write("own.toml", text)})
    )
    assert np.array_equal(one, other)


def test_a_verdict_names_three_doubts_and_counts_them_all(scene, own):
    results = screwgauge.run(scene, engines=("screw", "mujoco"), quantities=("joint_position",))
    doubtful = replace(results.solutions["mujoco"], warnings=("one", "two.", "three", "four"))
    banner = verdict(replace(results, solutions={**results.solutions, "mujoco": doubtful}))
    assert banner.text.startswith("one. two. three. All 4 reservations")


@pytest.fixture
def run(own, scene):
    def of(attributes, *quantities, rotor=None, mass="1.1"):
        files = own("mujoco", "xml", _B, f"& {attributes}")
        files.model.write_text(files.model.read_text(encoding="utf-8").replace('mass="1.1"', f'mass="{mass}"'))
        mechanism = scene.mechanism
        if rotor is not None:
            joints = (replace(j, rotor=np.full_like(j.rotor, rotor)) if j.name == "b" else j for j in mechanism.joints)
            mechanism = replace(mechanism, joints=tuple(joints))
        mine = replace(scene, mechanism=mechanism, models={"mujoco": files.model})
        return screwgauge.run(mine, engines=("screw", "mujoco"), quantities=quantities or ("actuator_force",))

    return of


def test_agreement_on_a_machine_that_is_damped_differently_is_no_plain_agreement(own, scene):
    files = own("pinocchio", "urdf", _AXIS, '&<dynamics damping="0.5"/>')
    mine = replace(scene, models={"pinocchio": files.model})
    results = screwgauge.run(mine, engines=("screw", "pinocchio"), quantities=("actuator_force",))
    banner = verdict(results)
    assert (results.exit_status, banner.word, banner.status) == (0, "✓ AGREE, but", "note")
    (term,) = results.left_out.terms
    assert (term.kind, term.names, term.file) == ("damping", ("joint a",), "own.urdf")
    assert summary(results)["left_out"][0]["size"] == term.size
    assert results.left_out.contained == {}  # rnea has no damping
    assert conclusion(results)[0].text.endswith(f"{phrase(term)}.")
    assert phrase(term).split(",")[0] in markdown(report(results, ()))


def test_what_an_engine_applies_of_its_file_is_taken_off_and_nobody_is_blamed(run):
    results = run('damping="0.1" frictionloss="1"', "actuator_force", "reaction")
    assert (results.exit_status, results.ok) == (0, True)
    assert {term.kind for term in results.left_out.terms} == {"damping", "dry friction"}
    assert results.left_out.contained == {}  # forces that all engines are given


def test_rotors_that_an_engine_has_of_its_file_are_taken_off(run):
    results = run('armature="0.1"', "actuator_force", "reaction")
    assert results.pairs["ok"].all()
    assert (results.exit_status, results.left_out.contained) == (1, {"mujoco": ("armature",)})


@pytest.mark.parametrize(("amount", "more"), [("0.1", []), ("0.3", ["armature"])])
def test_what_a_file_and_its_description_both_have_is_not_left_out(amount, more, run):
    results = run(f'armature="{amount}"', rotor=0.1)
    assert results.pairs["ok"].all()
    assert [term.kind for term in results.left_out.terms] == more


def test_a_file_without_the_rotor_of_its_description_departs_from_it(run):
    results = run("", rotor=0.1)
    assert results.exit_status == 1
    assert "unlike the description: rotor of b" in " ".join(repr(results).split())


def test_an_engine_that_differs_for_another_reason_too_is_still_named(run):
    results = run('damping="0.1"', mass="1.2")
    assert (results.exit_status, verdict(results).word) == (1, "✗ DIFFER")
    assert not results.judge[results.judge["engine"] == "mujoco"]["ok"].all()


def test_a_model_file_whose_engine_does_not_run_is_said(own, scene):
    files = own("mujoco", "xml", _B, "&")
    results = screwgauge.run(replace(scene, models={"mujoco": files.model}), engines=("screw",))
    assert any("(models.mujoco) is not read" in text for text in results.warnings)


@pytest.fixture
def simulated(write, own):
    write("four-bar.toml", data("four-bar.toml"))
    motion = "time = { times = [0, 0.05] }\nforward.rates = { crank = 3 }\n"
    text = f'mechanism = "four-bar.toml"\ngravity = [0, "-9.81", 0]\n{motion}'
    forward = screwgauge.load_scene(write("forward.toml", text))

    def of(engine, kind, old, new):
        models = {engine: own(engine, kind, old, new).model}
        return screwgauge.run(replace(forward, models=models), engines=("screw", engine))

    return of


@pytest.mark.slow
def test_damping_that_an_engine_leaves_out_of_a_simulation_is_measured(simulated, scene):
    results = simulated("pinocchio", *("urdf", _AXIS, '&<dynamics damping="0.5"/>'))
    assert results.ok
    (term,) = results.left_out.terms
    rate = results.values("joint_velocity", "screw")[:, scene.mechanism.coordinates.index("a")]
    assert term.size == pytest.approx(0.5 * np.abs(rate).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"),
    [(_B, '& frictionloss="0.3"'), ("<equality>", TENDON.replace('stiffness="3"', 'frictionloss="0.3"'))],
)
def test_friction_in_an_mjcf_is_in_no_simulation_and_measured(old, new, simulated):
    results = simulated("mujoco", "xml", old, new)
    assert results.ok
    assert [term.kind for term in results.left_out.terms] == ["dry friction"]
    assert results.left_out.terms[0].size > 0.0


@pytest.mark.slow
def test_a_stop_in_an_mjcf_closes_no_loop(simulated):
    results = simulated("mujoco", "xml", FLAGS, '</option><default><joint range="-1 1"/></default>')
    assert results.failures == {}
    assert verdict(results).word == "✗ DIFFER"
    residuals = results.judge.set_index(["engine", "residual"])["ok"]
    assert residuals["mujoco"]["loop_closure"].all()
