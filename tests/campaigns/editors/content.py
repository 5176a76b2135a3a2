import xml.etree.ElementTree as ET

import numpy as np
from campaigns.corpus.parts import child, pick
from campaigns.editors.elements import Edit, Editor, bodies, moving_joints, of_mjcf, of_urdf, put, two_of


@of_mjcf
def stiffness(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    return Edit(put(joint, "stiffness", rng.uniform(0.5, 5.0)), joint.get("name"))


def tendon(what: str) -> Editor:
    @of_mjcf
    def edit(root: ET.Element, rng: np.random.Generator) -> Edit:
        joints = [joint.get("name") for joint in two_of(moving_joints(root), rng)]
        fixed = ET.SubElement(child(root, "tendon"), "fixed", name="added", **{what: f"{rng.uniform(1.0, 5.0):.3g}"})
        for joint in joints:
            ET.SubElement(fixed, "joint", joint=joint, coef="1")
        return Edit(f"fixed tendon of {' and '.join(joints)} with {what} {fixed.get(what)}", "added")

    return edit


def option(name: str, value: str, item: str) -> Editor:
    @of_mjcf
    def edit(root: ET.Element, rng: np.random.Generator) -> Edit:
        child(root, "option").set(name, value)
        return Edit(f"option {name} {value}", item)

    return edit


@of_mjcf
def gravcomp(root: ET.Element, rng: np.random.Generator) -> Edit:
    body = pick(bodies(root), rng)
    return Edit(put(body, "gravcomp", rng.uniform(0.1, 1.0)), body.get("name"))


@of_mjcf
def servo(root: ET.Element, rng: np.random.Generator) -> Edit:
    motor = pick(root.iterfind("actuator/motor"), rng)
    motor.tag = "position"
    for name in ("gear", "ctrlrange", "forcerange", "ctrllimited", "forcelimited"):
        motor.attrib.pop(name, None)
    motor.set("kp", "100")
    return Edit("motor made a position servo, kp 100", motor.get("name"))


@of_mjcf
def force_range(root: ET.Element, rng: np.random.Generator) -> Edit:
    motor = pick([each for each in child(root, "actuator") if each.get("joint")], rng)
    motor.set("forcelimited", "true")
    return Edit(put(motor, "forcerange", [-0.5, 0.5]), motor.get("name"))


@of_mjcf
def weld(root: ET.Element, rng: np.random.Generator) -> Edit:
    one, two = two_of([body.get("name") for body in bodies(root)], rng)
    ET.SubElement(child(root, "equality"), "weld", name="added", body1=one, body2=two)
    return Edit(f"{one} welded to {two}", "added")


@of_mjcf
def pair(root: ET.Element, rng: np.random.Generator) -> Edit:
    geoms = [geom.get("name") for geom in root.iterfind("worldbody//geom") if geom.get("name")]
    one, two = two_of(geoms, rng)
    ET.SubElement(child(root, "contact"), "pair", geom1=one, geom2=two)
    return Edit(f"contact pair of {one} and {two}", "pair")


@of_urdf
def transmission(root: ET.Element, rng: np.random.Generator) -> Edit:
    joint = pick(moving_joints(root), rng)
    one = ET.SubElement(root, "transmission", name="added")
    ET.SubElement(one, "type").text = "transmission_interface/SimpleTransmission"
    ET.SubElement(one, "joint", name=joint.get("name"))
    motor = ET.SubElement(one, "actuator", name="added motor")
    ET.SubElement(motor, "mechanicalReduction").text = "50"
    return Edit(f"transmission of {joint.get('name')} with a reduction of 50", "transmission")


@of_urdf
def loops_beside(root: ET.Element, rng: np.random.Generator) -> Edit:
    name = pick(moving_joints(root), rng).get("name")
    text = f"closed_loop: []\ntype: []\njoint_name: [{name}]\njoint_type: [SPHERICAL]\n"
    return Edit("robot.yaml beside it makes the joint spherical", name, text)


CONTENT: dict[str, Editor] = {
    "tendon stiffness": tendon("stiffness"),
    "tendon damping": tendon("damping"),
    "tendon friction": tendon("frictionloss"),
    "density": option("density", "1000", "density"),
    "viscosity": option("viscosity", "0.9", "viscosity"),
    "integrator": option("integrator", "RK4", ""),
    "stiffness": stiffness,
    "gravcomp": gravcomp,
    "servo": servo,
    "force range": force_range,
    "weld": weld,
    "contact pair": pair,
    "transmission": transmission,
    "loops beside": loops_beside,
}
