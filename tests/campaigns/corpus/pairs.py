"""Pairs of files with what is to be said of them: own mechanisms, a user's files, edits, packages, parallel robots."""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
from campaigns.corpus import machines
from campaigns.corpus.edit_rows import PUBLIC, own_models, plain_copy, said_differently
from campaigns.corpus.edit_table import EDITS
from campaigns.corpus.linkage import Linkage, bent
from campaigns.corpus.mjcf_scrambler import scramble_mjcf
from campaigns.corpus.parts import NoPlaceError, Parts
from campaigns.corpus.planted import WORDS
from campaigns.corpus.poses import EYE, turn
from campaigns.corpus.writers import write_mjcf, write_toml, write_urdf
from campaigns.public import ROBOTS, installed

SAME, DIFFER = "SAME", "DIFFER"
SEED = 211
MODELS = Path(__file__).parents[3] / "models"
#: The built-in ones but for a four-bar of forty loops, and a variant that has another chart of the wrists alone.
OWN = (
    *("3-rps", "3-rrr", "3-upu", "3ups-upu-s", "3ups-upu-s-asymmetric", "3ups-upu-s-offset", "a01-pendulum"),
    *("a02-fourbar-2", "a03-andrews", "a04-bricard-box", "a04-bricard-thin", "a05-governor", "arm7", "bennett"),
    *("cart-pole", "delta", "double-cardan", "five-bar", "planetary-gear", "rccc", "sarrus", "screw-press"),
    *("slider-crank", "spatial-slider-crank", "stewart", "stewart-legs"),
)
#: Files of a built-in mechanism that are put against each other: a format or a cut apart, or both.
FORMS = ((".toml", "-full.xml"), (".urdf", ".xml"), (".urdf", "-full.urdf"), (".xml", "-full.urdf"))


class MissingError(Exception):
    """A package that is not installed."""


@dataclass(frozen=True, slots=True)
class Pair:
    """Two files, and what is to be said of them.

    Attributes:
        make: Writes them into a folder, or finds them. Raises `MissingError` where a package is not installed.
        expected: ``SAME`` or ``DIFFER``.
        planted: Of what differs, in words.
        named: A part that the first sentence has to lead with, as a regular expression; empty where any will do.
    """

    name: str
    group: str
    make: Callable[[Path], tuple[Path, Path]]
    expected: str = SAME
    planted: str = ""
    named: str = ""


def pairs() -> list[Pair]:
    return [*own(), *user(), *edits(), *packages(), *parallel(), *scrambled(), *disguised_models(), *common()]


# --- mechanisms that are built in


def own() -> Iterator[Pair]:
    for name in OWN:
        folder = MODELS / name
        for first, second in FORMS:
            files = folder / f"{name}{first}", folder / f"{name}{second}"
            yield Pair(f"{name}{first} {second}", "own", lambda _, files=files: files)  # type: ignore[misc]


def scrambled() -> Iterator[Pair]:
    for i, name in enumerate(OWN):

        def make(folder: Path, name: str = name, i: int = i) -> tuple[Path, Path]:
            a = MODELS / name / f"{name}.xml"
            done = scramble_mjcf(ET.parse(a).getroot(), np.random.default_rng([SEED, i]))
            b = folder / "scrambled.xml"
            ET.ElementTree(done.root).write(b, encoding="unicode")
            return a, b

        yield Pair(f"{name} scrambled", "scrambled", make)


def disguised_models() -> Iterator[Pair]:
    for package, files in PUBLIC.items():
        for i, file in enumerate(files):

            def make(folder: Path, name: str = f"{package}:{file}", i: int = i) -> tuple[Path, Path]:
                a = plain_copy(_installed(name), folder)
                done = said_differently(ET.parse(a).getroot(), np.random.default_rng([SEED, 2, i]))
                b = folder / f"disguised{a.suffix}"
                ET.ElementTree(done.root).write(b, encoding="unicode")
                return a, b

            path = Path(file)
            yield Pair(
                f"{path.parent.name if path.stem == 'robot' else path.stem}{path.suffix} disguised", "disguised", make
            )


# --- files as a user writes them


def _written(machine: Linkage, form: str, folder: Path, side: str) -> Path:
    folder = folder / side
    folder.mkdir()
    if form == "urdf":
        urdf, yaml = write_urdf(machine)
        (folder / "robot.urdf").write_text(urdf, encoding="utf-8")
        if yaml:
            (folder / "robot.yaml").write_text(yaml, encoding="utf-8")
        return folder / "robot.urdf"
    file = folder / f"{machine.name}.{form}"
    file.write_text(write_mjcf(machine) if form == "xml" else write_toml(machine), encoding="utf-8")
    return file


def two(
    name: str,
    group: str,
    a: tuple[Linkage, str],
    b: tuple[Linkage, str],
    expected: str = SAME,
    planted: str = "",
    named: str = "",
) -> Pair:
    def make(folder: Path) -> tuple[Path, Path]:
        return _written(*a, folder, "a"), _written(*b, folder, "b")

    return Pair(name, group, make, expected, planted, named)


def disguised(machine: Linkage, seed: int) -> Linkage:
    rng = np.random.default_rng([SEED, seed])
    return machine.renamed().moved(rng).reordered(rng)


def plain(machine: Linkage) -> Linkage:
    return replace(machine, joints=tuple(replace(j, damping=0.0, limits=None) for j in machine.joints))


def user() -> Iterator[Pair]:
    bar, other_bar = machines.four_bar(), machines.four_bar(0.7)
    yield two("four-bar urdf mjcf", "user", (bar, "urdf"), (bar, "xml"))
    yield two("four-bar urdf toml", "user", (bar, "urdf"), (bar, "toml"))
    yield two("four-bar mjcf, other pose", "user", (bar, "xml"), (other_bar, "xml"))
    yield two("four-bar urdf, disguised mjcf", "user", (bar, "urdf"), (disguised(bar, 1), "xml"))
    yield two("four-bar mjcf, other cut", "user", (bar, "xml"), (bar.with_cut("rocker_joint"), "xml"))
    arm, chain = machines.arm(1), machines.arm(2, 5, 2)
    yield two("arm urdf mjcf", "user", (arm, "urdf"), (arm, "xml"))
    yield two("arm urdf toml", "user", (plain(arm), "urdf"), (plain(arm), "toml"))
    yield two("arm urdf, disguised mjcf", "user", (arm, "urdf"), (disguised(arm, 2), "xml"))
    posed = bent(arm, {"axis1": 0.4, "axis3": 0.05, "axis4": -0.3})
    yield two("arm mjcf, other pose", "user", (arm, "xml"), (posed, "xml"))
    yield two(
        "arm mjcf, flipped and disguised", "user", (chain, "xml"), (disguised(chain.flipped(["axis1"]), 3), "xml")
    )
    delta = machines.delta_balls()
    yield two("delta urdf toml", "user", (delta, "urdf"), (delta, "toml"))
    yield two(
        "delta mjcf, other pose, disguised", "user", (delta, "xml"), (disguised(machines.delta_balls(-0.05), 4), "xml")
    )
    heavy = bar.with_body("rocker", mass=1.0)
    yield two(
        "four-bar, heavier rocker", "user", (bar, "urdf"), (heavy, "xml"), DIFFER, "mass +0.1 kg", r"\brocker\b.*mass"
    )
    longer = bar.with_joint("tip_joint", point=bar.joints[-1].point + np.array([0.01, 0.0, 0.0]))
    yield two(
        "four-bar, tip elsewhere",
        "user",
        (bar, "urdf"),
        (longer, "xml"),
        DIFFER,
        "tip 10 mm along x",
        r"\btip_joint|\bcoupler|\bloop\d",
    )
    body = arm.bodies[2]
    off = arm.with_body("link2", com=body.com + np.array([0.0, 0.02, 0.0]))
    yield two(
        "arm, centre of mass off",
        "user",
        (arm, "urdf"),
        (disguised(off, 5), "xml"),
        DIFFER,
        "20 mm",
        r"\blink2\b.*centre of mass",
    )
    across = np.cross(arm.joints[4].axes[0], EYE[1])
    tilted = arm.with_joint("axis4", axes=(turn(across, 0.05) @ arm.joints[4].axes[0],))
    yield two("arm, tilted axis", "user", (arm, "urdf"), (tilted, "xml"), DIFFER, "axis 0.05 rad", r"\baxis4\b")
    base = delta.with_joint("hip1", point=delta.joints[5].point + np.array([0.0, 0.0, 0.005]))
    yield two("delta, hip elsewhere", "user", (delta, "urdf"), (base, "toml"), DIFFER, "hip 5 mm along z", r"\bhip1\b")
    light = delta.with_body("rod1a", mass=0.1)
    yield two(
        "delta, lighter rod", "user", (delta, "xml"), (light, "toml"), DIFFER, "mass -0.05 kg", r"\brod1a\b.*mass"
    )


def common() -> Iterator[Pair]:
    arm, limbs = machines.arm(1), machines.tree(1)
    all_ = r"(?=.*(\ball\b|\bevery\b|\beach\b|\b6\b|masses|inertias))(?=.*"

    def bodies(factor: float, what: str) -> Linkage:
        return replace(arm, bodies=tuple(replace(b, **{what: factor * getattr(b, what)}) for b in arm.bodies))

    def of(name: str, a: Linkage, b: Linkage, planted: str, named: str) -> Pair:
        return two(name, "common", (a, "urdf"), (b, "xml"), DIFFER, planted, named)

    yield of(
        "all masses x 1.01", arm, bodies(1.01, "mass"), "masses x 1.01", rf"{all_}mass).*(\bx?1\.01|\+1(\.0+)? ?%)"
    )
    yield of(
        "all masses in grams", arm, bodies(1000.0, "mass"), "masses x 1000", rf"{all_}mass).*(grams|in g\b|1000|1e3)"
    )
    doubled = bodies(2.0, "inertia")
    yield of("all inertias doubled", arm, doubled, "inertias x 2", rf"{all_}inertia).*(\bx?2\b|100(\.0+)? ?%)")
    damped = replace(arm, joints=tuple(replace(j, damping=2.0 * j.damping) for j in arm.joints))
    yield of("damping doubled", arm, damped, "damping x 2", rf"{all_}damping).*(\bx?2\b|100(\.0+)? ?%)")
    last = limbs.joints[-1]
    fewer = replace(limbs, bodies=limbs.bodies[:-1], joints=limbs.joints[:-1], independent=limbs.independent[:-1])
    yield of("a limb is missing", limbs, fewer, f"without {last.child}", rf"\b({last.name}|{last.child})\b")
    slide = arm.with_joint("axis4", kind="P", limits=(-0.2, 0.2))
    yield of("a slide in place of a hinge", arm, slide, "axis4 slides", r"\baxis4\b.*(slide|prismatic)")


# --- single edits


def edits(count: int = 49) -> Iterator[Pair]:
    for number in range(count):
        kind = [*EDITS][number % len(EDITS)]

        def make(folder: Path, kind: str = kind, number: int = number) -> tuple[Path, Path]:
            a, root, _ = _edit(kind, number, folder)
            b = folder / f"edited{a.suffix}"
            ET.ElementTree(root).write(b, encoding="unicode")
            return a, b

        yield Pair(f"edit {number}", "edits", make, DIFFER, kind, f"edit:{number}")


def edit_named(number: int, folder: Path) -> tuple[str, str, str]:
    a, _, planted = _edit([*EDITS][number % len(EDITS)], number, folder)
    words = "|".join(WORDS[what] for what in (planted.what, *planted.may))  # type: ignore[attr-defined]
    items = [planted.item, *planted.also]  # type: ignore[attr-defined]
    names = "|".join(rf"\b{item.partition(' ')[2]}\b" for item in items if item)
    return f"{a.name}: {planted.kind} of {planted.item or 'the model'}", words, names  # type: ignore[attr-defined]


def _edit(kind: str, number: int, folder: Path) -> tuple[Path, ET.Element, object]:
    files = [*own_models(folder).values()]
    files += [MODELS / name / f"{name}.xml" for name in OWN]
    rng = np.random.default_rng([SEED, 1, number])
    for i in rng.permutation(len(files)):
        parts = Parts.read(files[int(i)])
        try:
            planted = EDITS[kind](parts, rng)
        except NoPlaceError:
            continue
        return files[int(i)], parts.root, planted
    raise LookupError(f"no model has a place for {kind}")


# --- the same robot, in packages


def packages() -> Iterator[Pair]:
    for row in ROBOTS["pairs"]:

        def make(_: Path, files: tuple[str, str] = (row["a"], row["b"])) -> tuple[Path, Path]:
            return _installed(files[0]), _installed(files[1])

        yield Pair(row["name"], "packages", make, row["expected"])


def _installed(name: str) -> Path:
    package, _, file = name.partition(":")
    try:
        return installed(package, file)
    except PackageNotFoundError:
        raise MissingError(f"{package} is not installed") from None


# --- parallel robots: URDF and robot.yaml against MJCF


def parallel() -> Iterator[Pair]:
    some = {
        "four-bar": (machines.four_bar(), machines.four_bar(0.8), ("coupler_joint",)),
        "five-bar": (machines.five_bar(), machines.five_bar(2.2, 1.3), ("left_elbow",)),
        "3-rrr": (machines.three_rrr(), machines.three_rrr(-0.02, 0.01, 0.2), ("elbow0", "corner2")),
        "delta": (machines.delta_balls(), machines.delta_balls(0.06, 0.02, -0.48), _all_but("wrist2b", 5)),
        "stewart": (machines.stewart(), machines.stewart(-0.03, 0.02, 0.53), _all_but("top4", 6)),
    }
    for name, (one, posed, cut) in some.items():
        yield two(f"{name}: yaml, renamed mjcf", "parallel", (one, "urdf"), (disguised(one, 10), "xml"))
        yield two(f"{name}: yaml, mjcf cut elsewhere", "parallel", (one, "urdf"), (one.with_cut(*cut), "xml"))
        other = disguised(posed.with_cut(*cut), 11)
        yield two(f"{name}: yaml, yaml in another pose and cut", "parallel", (one, "urdf"), (other, "urdf"))
    bar = machines.five_bar()
    ball = bar.with_joint("tip", kind="S", axes=())
    yield two("five-bar: a hinge as one point", "parallel", (bar, "xml"), (ball, "urdf"))
    delta = machines.delta_balls()
    wrong = delta.with_joint("wrist1b", point=delta.joints[9].point + np.array([0.0, 0.004, 0.0]))
    yield two(
        "delta: a wrist off",
        "parallel",
        (delta, "urdf"),
        (wrong, "xml"),
        DIFFER,
        "wrist 4 mm along y",
        r"\bwrist1b|\brod1b|\bloop\d",
    )
    legs = machines.stewart()
    heavy = legs.with_body("upper2", mass=0.5)
    other = heavy.with_cut(*_all_but("top4", 6))
    yield two(
        "stewart: a heavier leg, cut elsewhere",
        "parallel",
        (legs, "urdf"),
        (other, "xml"),
        DIFFER,
        "mass +0.1 kg",
        r"\bupper2\b.*mass",
    )


def _all_but(joint: str, count: int) -> tuple[str, ...]:
    if joint.startswith("top"):
        return tuple(name for i in range(count) if (name := f"top{i}") != joint)
    return tuple(name for i in range(3) for side in "ab" if (name := f"wrist{i}{side}") != joint)
