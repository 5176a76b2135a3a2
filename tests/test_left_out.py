"""What acts in a model file and is not modelled is measured at the compared states, or the file is refused by name."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import screwgauge
from screwgauge.reference.resistance import without_resistance
from support.errors import DescriptionError, ModelFileError, UnknownNameError
from support.judging import MeasuredForces, admitted_by, answer_at, measure
from support.mechanism import load_mechanism, same_content
from support.models import Options, description, import_model
from support.pages import markdown, terminal
from support.report import conclusion, phrase, report, run_in_terminal, summary, verdict

INERTIAL = '<inertial pos="0.1 0.02 0.03" mass="{}" diaginertia="0.02 0.03 0.025"/>'
CHAIN = (
    '<mujoco><compiler angle="radian"/><option {option}/><worldbody>'
    '<body name="a" {a}><joint name="ja" axis="0 1 0" {ja}/>' + INERTIAL.format(1.2) + '<site name="s"/>'
    '<body name="b" pos="0.3 0 0" euler="0.2 0.3 0.1"><joint name="jb" type="slide" axis="1 0 0" {jb}/>'
    + INERTIAL.format(0.7)
    + '<body name="c" pos="0.3 0 0.1" {c}><joint name="jc" axis="1 0 0" {jc}/>'
    + INERTIAL.format(0.5)
    + '<body name="d" pos="0.1 0 0.1" {d}>'
    + INERTIAL.format(0.2)
    + '<site name="e" pos="0.1 0.02 0.05"/></body>'
    + "</body></body></body>{world}</worldbody>"
    '{end}<actuator><motor name="ma" joint="ja" {ma}/><motor joint="jb"/><motor joint="jc"/>{motors}</actuator>'
    "</mujoco>"
)


def chain(**parts: str) -> str:
    """Three joints in a row: a hinge, a slide, a hinge."""
    names = ("option", "a", "ja", "jb", "c", "jc", "d", "world", "end", "ma", "motors")
    return CHAIN.format(**{**dict.fromkeys(names, ""), **parts})


THREE = (
    '<tendon><fixed name="t" {}><joint joint="ja" coef="1.5"/><joint joint="jb" coef="2"/>'
    '<joint joint="jc" coef="-2"/></fixed></tendon>'
)
FLEX = (
    '<body name="cloth"><flexcomp name="f" type="grid" count="3 3 1" spacing="0.1 0.1 0.1" dim="2" radius="0.01" '
    'mass="0.1"><contact contype="0" conaffinity="0"/><edge equality="{}"/></flexcomp></body>'
)
PATH = (
    '<tendon><spatial name="r" {}><site site="w"/><site site="s"/>{}<site site="e"/></spatial></tendon>',
    '<site name="w" pos="0 0.2 1"/><geom name="g" size="0.01" contype="0" conaffinity="0"/>',
)
BALL = '<body name="z" pos="0 1 0"><joint name="ball" type="ball" {}/>' + INERTIAL.format(0.8) + "</body>"
#: A tendon of one joint that a square of the length of another one holds.
BY_POWERS = """<tendon><fixed name="u"><joint joint="ja" coef="1"/></fixed></tendon>
<equality><tendon name="e" tendon1="u" tendon2="t" polycoef="0 1 1 0 0"/></equality>"""
#: File, and what its refusal names.
REFUSED = {
    "powers of a sum": (chain(end=THREE.format("") + BY_POWERS), "equality e"),
    "flex held": (chain(world=FLEX.format("true")), "equality"),
    "flex": (chain(world=FLEX.format("false")), "flexible bodies"),
    "tendon round a geom": (
        chain(world=PATH[1], end=PATH[0].format('stiffness="5"', '<geom geom="g"/>')),
        "tendon r pulls, and runs over geoms",
    ),
    "spring that yields": (chain(ja='stiffness="2" springyield="0.1"'), "yield of springs of joint ja"),
    "ellipsoid": (
        chain(option='density="2"', world='<geom fluidshape="ellipsoid" size="1"/>'),
        "fluid shape of geoms",
    ),
    "weight borne by some": (
        chain(c='gravcomp="1"', jc='actuatorgravcomp="true"'),
        "actuators bear the weight of body c",
    ),
    "rotor of a ball": (
        chain(world=BALL.format(""), motors='<motor name="x" joint="ball" armature="1"/>'),
        "actuator x",
    ),
    "spring of a ball": (chain(world=BALL.format('stiffness="1"')), "joint ball is a ball joint with a spring"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_acts_and_cannot_be_measured_is_refused_by_name(case, write):
    text, name = REFUSED[case]
    path = write("own.xml", text)
    with pytest.raises(ModelFileError, match=name):
        import_model(path)
    with pytest.raises(ModelFileError, match=name):
        screwgauge.load_scene(path)


@pytest.mark.parametrize("end", ['<tendon name="e" tendon1="t" active="false"/>', ""])
def test_what_is_not_active_is_not_refused(end, write):
    import_model(write("own.xml", chain(end=THREE.format("") + f"<equality>{end}</equality>")))


def test_an_equality_that_the_reader_does_not_read_is_refused(write):
    path = write("own.xml", chain(end='<equality><joint name="e" joint1="jc" joint2="ja"/></equality>'))
    with pytest.raises(ModelFileError, match="equality e, which pinocchio does not read"):
        import_model(path, Options(library="pinocchio"))


LAWS = 'armature="0.02" damping="0.3 0.1 0.2" frictionloss="0.4" stiffness="2 1 3" springref="0.1"'
#: A file with everything that is measured, by what it has.
MEASURED = {
    "hinge and slide": {"ja": LAWS, "jb": 'armature="0.3" damping="2" frictionloss="0.2" stiffness="5"'},
    "actuator": {"ma": 'gear="10" armature="1e-3" damping="0.002 0.001"'},
    "tendon": {"end": THREE.format('stiffness="3 2" damping="0.5 0.1" armature="0.01" springlength="-0.1 0.1"')},
    "tendon over sites": {
        "world": PATH[1],
        "end": PATH[0].format('stiffness="30 2" damping="0.5 0.1" armature="0.1" springlength="0.1 0.9"', ""),
    },
    "actuator of a tendon": {
        "end": THREE.format(""),
        "motors": '<motor tendon="t" gear="3" armature="2e-3" damping="0.01 0.02"/>',
    },
    "weight borne by some parts": {"a": 'gravcomp="1"', "c": 'gravcomp="0.5"'},
    "weight borne by actuators": {
        **dict.fromkeys(("a", "c"), 'gravcomp="1"'),
        **dict.fromkeys(("ja", "jb", "jc"), 'actuatorgravcomp="true"'),
    },
    "dense medium in the wind": {"option": 'density="100" wind="1 0.5 0.2"'},
    "viscous medium": {"option": 'viscosity="3"'},
    "switched off": {"option": 'density="0"><flag spring="disable" damper="disable"/></option><option', "ja": LAWS},
}


def moving(path, bare: bool = True):
    """Forces that are left out of a file along the motion of its scene, whose springs are taken off if `bare`.

    Generalized forces without dry friction, which is none of MuJoCo's inverse dynamics.
    """
    scene = screwgauge.load_scene(path)
    scene = replace(scene, applied=replace(scene.applied, springs=())) if bare else scene
    scene = replace(scene, mechanism=without_resistance(scene.mechanism, "friction"))
    wanted = ("joint_position", "joint_velocity", "joint_acceleration", "generalized_force")
    solution = screwgauge.run(scene, ["screw"], wanted).solutions["screw"]
    answer = answer_at(scene.mechanism, scene.problem(wanted), solution, np.arange(len(scene.t)))
    (part,) = MeasuredForces(lambda: iter([(answer, admitted_by(answer))]), scene.mechanism.left_out).parts()
    return solution, part


def of_mujoco(path, answer, bare: bool) -> np.ndarray:
    """``mj_inverse`` along the coordinates of an answer, dry friction off: with it MuJoCo follows the acceleration."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), []
    columns = [answer.mechanism.coordinates.index(model.joint(i).name) for i in range(model.njnt)]
    for q, qd, qdd in zip(*answer.joints, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[columns], qd[columns], qdd[columns]
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse[np.argsort(columns)].copy())
    return np.array(out)[:, answer.mechanism.independent_columns]


@pytest.mark.parametrize("case", MEASURED)
def test_what_is_left_out_is_what_mujoco_adds(case, write):
    path = write("own.xml", chain(**MEASURED[case]))
    solution, forces = moving(path)
    added = [forces.generalized(wrenches) for kind, wrenches in forces.needed.items() if kind != "dry friction"]
    rigid = solution.values["generalized_force"].array
    expected = of_mujoco(path, forces.answer, bare=True)
    assert np.abs(rigid + sum(added, np.zeros_like(rigid)) - expected).max() <= 1e-13 * np.abs(expected).max()
    assert added or case in ("switched off", "weight borne by actuators")


@pytest.mark.parametrize("kind", ["ball", "free"])
def test_a_joint_of_several_freedoms_resists_as_in_mujoco(kind, write):
    laws = 'armature="0.3" damping="0.4 0.2"'
    path = write("own.xml", chain(world=BALL.format(laws).replace('type="ball"', f'type="{kind}"')))
    _, forces = moving(path)
    (one,) = forces.answer.mechanism.left_out
    assert (one.of, one.armature, one.damping) == ("joint ball", 0.3, (0.4, 0.2))
    answer, k = forces.answer, forces.answer.mechanism.body_index["z"] - 1
    com, body = answer.motion.com, answer.motion.bodies
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    dof, i = model.joint("ball").dofadr[0], model.joint("ball").qposadr[0]
    for n in range(0, len(answer.t), 10):
        R, p = body.R[n, k], body.p[n, k]
        w, b = R.T @ body.w[n, k], R.T @ body.b[n, k]
        q = np.zeros(4)
        mujoco.mju_mat2Quat(q, np.ascontiguousarray(R).ravel())
        free = kind == "free"
        data.qpos[i : i + 4 + 3 * free] = np.concatenate([p, q]) if free else q
        data.qvel[dof:] = np.concatenate([body.v[n, k], w]) if free else w
        data.qacc[dof:] = np.concatenate([body.a[n, k], b]) if free else b
        mujoco.mj_inverse(model, data)
        expected = model.dof_armature[dof:] * data.qacc[dof:] - data.qfrc_passive[dof:]
        wrench = sum(wrenches[n, k] for wrenches in forces.needed.values())
        moment = wrench[3:] - np.cross(p - com.p[n, k], wrench[:3])
        got = np.concatenate([wrench[:3], R.T @ moment]) if free else R.T @ moment
        assert np.abs(got - expected).max() <= 1e-12 * np.abs(expected).max()


def test_a_description_keeps_what_is_left_out_of_its_file(write):
    parts = {"ja": LAWS, "a": 'gravcomp="0.5"', "option": 'density="9" viscosity="2" wind="1 0 2"'}
    parts["end"] = THREE.format('stiffness="3 2" frictionloss="0.2" springlength="-0.1 0.1"')
    parts["end"] += PATH[0].format('stiffness="30" armature="0.1"', "")
    mechanism = import_model(write("own.xml", chain(world=PATH[1] + BALL.format('damping="0.2"'), **parts))).mechanism
    again = load_mechanism(write("again.toml", description(mechanism)))
    assert len(mechanism.left_out) == len(again.left_out) == 10
    for one, other in zip(mechanism.left_out, again.left_out, strict=True):
        assert type(one) is type(other)
        assert same_content(one, other)


def test_a_description_refuses_what_it_does_not_know(write):
    text = description(import_model(write("own.xml", chain(ja=LAWS))).mechanism)
    head, entry = text.split("[[left_out]]")
    wrong = {
        "unknown coordinate": entry.replace("ja = 1", "jx = 1"),
        "unknown key": entry + "mass = 1\n",
        "no number": entry.replace("stiffness = [2, 1, 3]", 'stiffness = "much"'),
        "acts on nothing": "\nof = 'joint ja'\n",
        "no name": entry.replace('of = "joint ja"', ""),
    }
    for name, bad in wrong.items():
        assert bad != entry, name
        with pytest.raises((DescriptionError, UnknownNameError)):
            load_mechanism(write("bad.toml", f"{head}[[left_out]]{bad}"))


FIVE_BAR = """<mujoco model="five-bar"><option gravity="0 0 -9.81"/><default><joint axis="0 1 0"/></default><worldbody>
<body name="l1" pos="-.06 0 0"><joint name="m1"/>
<inertial pos="-.03 0 -.04" mass=".12" diaginertia="2e-4 2e-4 1e-4"/>
<body name="l2" pos="-.06 0 -.08"><joint name="p1"/>
<inertial pos=".06 0 -.05" mass=".11" diaginertia="2e-4 2e-4 1e-4"/><site name="e1" pos=".12 0 -.10"/></body></body>
<body name="r1" pos=".06 0 0"><joint name="m2"/><inertial pos=".03 0 -.04" mass=".12" diaginertia="2e-4 2e-4 1e-4"/>
<body name="r2" pos=".06 0 -.08"><joint name="p2"/><inertial pos="-.06 0 -.05" mass=".11" diaginertia="2e-4 2e-4 1e-4"/>
<site name="e2" pos="-.12 0 -.10"/></body></body></worldbody><equality><connect site1="e1" site2="e2"/></equality>
<tendon><fixed name="t" {0}><joint joint="m1" coef="1"/><joint joint="m2" coef="-1"/></fixed></tendon>
<actuator><motor name="m1" joint="m1"/><motor name="m2" joint="m2"/></actuator></mujoco>"""
GAIT = """mechanism = "{}"
motion.m1.harmonics = [[12, 0, 0.2]]
motion.m2.harmonics = [[12, 0, -0.2]]
time = {{ duration = 0.5, step = 0.05 }}
quantities = ["actuator_force"]
engines = ["screw", "mujoco"]
"""
ROTOR = 0.005


@pytest.fixture
def gait(write):
    """A scene of a five-bar whose motors turn a rotor by their difference, and what that takes along its motion."""

    def make(tendon: str = f'armature="{ROTOR}"', source: str = ""):
        path = write(f"five-bar-{len(tendon)}.xml", FIVE_BAR.format(tendon))
        if source == "gone":
            text = description(import_model(path).mechanism)
            path.unlink()
            path = write("five-bar.toml", text)
        return screwgauge.load_scene(write("gait.toml", GAIT.format(path.name)))

    return make


def logged(scene, torques):
    """The scene with a table of torques. Shape (n, 2)."""
    table = screwgauge.Recorded(
        scene.t, dict(zip(("m1", "m2"), torques.T, strict=True)), error={"actuator_force": 1e-9}
    )
    return scene.beside(log=table)


@pytest.fixture
def rigid(gait):
    """Torques without the rotor, and what it takes besides."""
    scene, shares = gait(""), np.array([1.0, -1.0])
    torques = screwgauge.run(scene, ["screw"]).values("actuator_force")
    return torques, ROTOR * np.outer(scene.motion.ydd @ shares, shares)


@pytest.mark.parametrize("source", ["there", "gone"])
def test_a_log_of_a_machine_with_rotors_is_right_and_the_rotors_are_named(source, gait, rigid):
    torques, rotors = rigid
    results = screwgauge.run(logged(gait(source=source), torques + rotors), ["screw", "mujoco", "log"])
    (term,) = results.left_out.terms
    assert (term.kind, term.names, term.inertia) == ("armature", ("tendon t",), True)
    assert term.size == pytest.approx(np.abs(rotors).max(), rel=1e-12, abs=0)
    assert term.of == pytest.approx(np.abs(torques + rotors).max(), rel=1e-9, abs=0)
    assert results.left_out.contained == {"log": ("armature",)}
    assert results.pairs["ok"].all()
    assert results.judge["ok"].all()
    assert (results.ok, results.exit_status) == (False, 1)
    assert conclusion(results)[0].text.endswith(f"the file has more: {phrase(term)}.")


@pytest.mark.parametrize(
    "wrong",
    [
        lambda torques, rotors: torques + 2.0 * rotors,
        lambda torques, rotors: torques - rotors,
        lambda torques, rotors: -(torques + rotors),
        lambda torques, rotors: torques + rotors + 1e-6 * np.sin(np.arange(torques.size)).reshape(torques.shape),
        lambda torques, rotors: (torques + rotors)[:, ::-1],
    ],
    ids=["twice the rotors", "rotors turned round", "sign", "noise", "columns exchanged"],
)
def test_a_log_that_is_wrong_for_another_reason_is_faulted(wrong, gait, rigid):
    results = screwgauge.run(logged(gait(), wrong(*rigid)), ["screw", "mujoco", "log"])
    assert not results.judge[results.judge["engine"] == "log"]["ok"].all()
    assert results.exit_status == 1
    assert verdict(results).word == "✗ DIFFER"


def test_a_log_without_rotors_agrees_as_it_is(gait, rigid):
    results = screwgauge.run(logged(gait(), rigid[0]), ["screw", "mujoco", "log"])
    assert results.pairs["ok"].all()
    assert results.left_out.contained == {}


def test_passive_forces_alone_are_named_and_pass(gait):
    results = screwgauge.run(gait('frictionloss="0.02" damping="0.1"'))
    damping, friction = results.left_out.terms
    assert (damping.kind, damping.names) == ("damping", ("tendon t",))
    assert (friction.kind, friction.size) == ("dry friction", pytest.approx(0.02))
    assert (results.ok, results.exit_status) == (True, 0)
    assert conclusion(results)[0].text.endswith(f"the file has more: {phrase(damping)}; {phrase(friction)}.")


def test_springs_that_the_scene_has_are_not_left_out(write):
    scene = screwgauge.load_scene(write("own.xml", chain(jb='stiffness="5" damping="2"')))
    assert len(scene.applied.springs) == 1
    assert screwgauge.run(scene.at([0.0, 0.1])).left_out.terms == ()


def test_what_is_left_out_stands_on_every_page(gait):
    results = screwgauge.run(gait())
    (term,) = results.left_out.terms
    (entry,) = summary(results)["left_out"]
    assert (entry["kind"], entry["size"], entry["inertia"]) == ("armature", term.size, True)
    said = markdown(report(results, ()))
    assert phrase(term) in said
    assert "tendon t" in said
    assert phrase(term) in " ".join(terminal(run_in_terminal(results)).split())


@pytest.mark.parametrize(("tendon", "status"), [('frictionloss="0.02"', 0), (f'armature="{ROTOR}"', 1)])
def test_a_gate_says_so_of_a_file_and_of_what_was_imported(tendon, status, write):
    path = write("five-bar.xml", FIVE_BAR.format(tendon))
    scene = write("own.toml", GAIT.format("own-description.toml"))
    write("own-description.toml", description(import_model(path).mechanism))
    check = screwgauge.check(path, scene)
    assert check.exit_status == status
    assert all("tendon t, up to" in row.more for row in check.rows)
    assert "tendon t, up to" in " ".join(repr(check).split())


def test_long_motions_are_measured_part_by_part(gait, monkeypatch):
    scene, sizes = gait(), []
    for numbers in (measure.NUMBERS, 1):
        monkeypatch.setattr(measure, "NUMBERS", numbers)
        (term,) = screwgauge.run(scene, ["screw"]).left_out.terms
        sizes.append((term.size, term.of, term.t))
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-14, abs=0)


def test_a_simulation_is_measured_where_its_velocities_are_not_asked_for(write):
    path = write("own.xml", chain(end=THREE.format('frictionloss="0.2" armature="0.01"')))
    text = description(import_model(path).mechanism)
    write("own.toml", text)
    forward = 'mechanism = "own.toml"\nquantities = ["joint_position"]\nengines = ["screw"]\n'
    forward += "time.times = [0, 0.1]\nforward = {}\n"
    results = screwgauge.run(screwgauge.load_scene(write("forward.toml", forward)))
    assert {term.kind: term.size > 0.0 for term in results.left_out.terms} == {"armature": True, "dry friction": True}
    assert results.exit_status == 1
