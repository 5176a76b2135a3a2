from dataclasses import replace

import mujoco
import numpy as np
import pytest

import screwgauge
from screwgauge.reference.resistance import without_resistance
from support.claims import table
from support.errors import DescriptionError, ModelFileError, UnknownNameError
from support.judging import admissible_motion, answer_at, measure, measured_parts
from support.mechanism import load_mechanism, same_content
from support.models import Options, description, import_model
from support.pages import markdown, terminal
from support.report import conclusion, phrase, report, run_in_terminal, summary, verdict

TABLE = table("left_out")
ROTOR = 0.005


def described(path) -> str:
    return description(import_model(path).mechanism)


def text_of(name: str, *arguments: str) -> str:
    return TABLE["texts"][name].format(*arguments)


def chain(**parts: str | list[str]) -> str:
    names = ("option", "a", "ja", "jb", "c", "jc", "d", "world", "end", "ma", "motors")
    given = {name: part if isinstance(part, str) else text_of(*part) for name, part in parts.items()}
    return TABLE["texts"]["chain"].format(**{**dict.fromkeys(names, ""), **given})


@pytest.mark.parametrize("case", TABLE["refused"])
def test_what_acts_and_cannot_be_measured_is_refused_by_name(case, write):
    row = TABLE["refused"][case]
    path = write("own.xml", chain(**row["parts"]))
    for take in (import_model, screwgauge.load_scene):
        with pytest.raises(ModelFileError, match=row["says"]):
            take(path)


@pytest.mark.parametrize("end", ['<tendon name="e" tendon1="t" active="false"/>', ""])
def test_what_is_not_active_is_not_refused(end, write):
    import_model(write("own.xml", chain(end=text_of("three", "") + f"<equality>{end}</equality>")))


def test_an_equality_that_the_reader_does_not_read_is_refused(write):
    path = write("own.xml", chain(end='<equality><joint name="e" joint1="jc" joint2="ja"/></equality>'))
    with pytest.raises(ModelFileError, match="equality e, which pinocchio"):
        import_model(path, Options(library="pinocchio"))


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
    (part,) = measured_parts(lambda: iter([(answer, admissible_motion(answer.motion))]), scene.mechanism.left_out)
    return solution, part


def of_mujoco(path, answer, bare: bool) -> np.ndarray:
    """``mj_inverse`` along the coordinates of an answer, without dry friction."""
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), []
    columns = [answer.mechanism.coordinates.index(model.joint(i).name) for i in range(model.njnt)]
    for q, qd, qdd in zip(*answer.joints, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[columns], qd[columns], qdd[columns]
        mujoco.mj_inverse(model, data)
        out.append(data.qfrc_inverse[np.argsort(columns)].copy())
    return np.array(out)[:, answer.mechanism.independent_columns]


@pytest.mark.parametrize("case", TABLE["measured"])
def test_what_is_left_out_is_what_mujoco_adds(case, write):
    path = write("own.xml", chain(**TABLE["measured"][case]))
    solution, forces = moving(path)
    added = [forces.generalized_forces(wrenches) for kind, wrenches in forces.needed.items() if kind != "dry friction"]
    rigid = solution.values["generalized_force"].array
    expected = of_mujoco(path, forces.answer, bare=True)
    assert np.abs(rigid + sum(added, np.zeros_like(rigid)) - expected).max() <= 1e-13 * np.abs(expected).max()
    assert added or case in ("switched off", "weight borne by actuators")


@pytest.mark.parametrize("kind", ["ball", "free"])
def test_a_joint_of_several_freedoms_resists_as_in_mujoco(kind, write):
    laws = 'armature="0.3" damping="0.4 0.2"'
    path = write("own.xml", chain(world=text_of("ball", laws).replace('type="ball"', f'type="{kind}"')))
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
    parts = {"ja": text_of("laws"), "a": 'gravcomp="0.5"', "option": 'density="9" viscosity="2" wind="1 0 2"'}
    parts["end"] = text_of("three", 'stiffness="3 2" frictionloss="0.2" springlength="-0.1 0.1"')
    parts["end"] += text_of("path", 'stiffness="30" armature="0.1"', "")
    parts["world"] = text_of("sites") + text_of("ball", 'damping="0.2"')
    mechanism = import_model(write("own.xml", chain(**parts))).mechanism
    again = load_mechanism(write("again.toml", description(mechanism)))
    assert len(mechanism.left_out) == len(again.left_out) == 10
    for one, other in zip(mechanism.left_out, again.left_out, strict=True):
        assert type(one) is type(other)
        assert same_content(one, other)


def test_a_description_refuses_what_it_does_not_know(write):
    text = described(write("own.xml", chain(ja=text_of("laws"))))
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


@pytest.fixture
def gait(write):
    def make(tendon: str = f'armature="{ROTOR}"', source: str = ""):
        path = write(f"five-bar-{len(tendon)}.xml", text_of("five-bar", tendon))
        if source == "gone":
            text = described(path)
            path.unlink()
            path = write("five-bar.toml", text)
        return screwgauge.load_scene(write("gait.toml", text_of("gait", path.name)))

    return make


def logged(scene, torques):
    table = screwgauge.Recorded(
        scene.t, dict(zip(("m1", "m2"), torques.T, strict=True)), error={"actuator_force": 1e-9}
    )
    return scene.beside(log=table)


@pytest.fixture
def rigid(gait):
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
    assert conclusion(results)[0].text.endswith(f"the file also contains: {phrase(term)}.")


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
    assert conclusion(results)[0].text.endswith(f"the file also contains: {phrase(damping)}; {phrase(friction)}.")


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
    path = write("five-bar.xml", text_of("five-bar", tendon))
    scene = write("own.toml", text_of("gait", "own-description.toml"))
    write("own-description.toml", described(path))
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
    path = write("own.xml", chain(end=text_of("three", 'frictionloss="0.2" armature="0.01"')))
    text = described(path)
    write("own.toml", text)
    forward = 'mechanism = "own.toml"\nquantities = ["joint_position"]\nengines = ["screw"]\n'
    forward += "time.times = [0, 0.1]\nforward = {}\n"
    results = screwgauge.run(screwgauge.load_scene(write("forward.toml", forward)))
    assert {term.kind: term.size > 0.0 for term in results.left_out.terms} == {"armature": True, "dry friction": True}
    assert results.exit_status == 1
