import re
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from screwgauge import diagnose, models
from support.claims import FOLDER, cases, filled, table
from support.facts import fits, matches, replaced, same, told

TABLE = table("diagnosis")
#: Folders of files that rows name.
FOLDERS = Path(models.__file__).parent, FOLDER.parent / "data"
KEYS = {"a", "b", "edits", "edits_a", "mounted", "units", "mirrored", "renamed", "map", "only", "back"}
KEYS |= {"beside", "beside_a", "edits_beside", "libraries", "has", "at_most", "at_least", "explains", "agree"}
KEYS |= {"facts", "among", "verdict", "causes", "lead", "shares", "reasons", "joints", "how", "mobility", "fixed"}
KEYS |= {"notes", "kinds", "says", "silent"}


def text_of(name: str) -> str:
    if name not in TABLE["models"]:
        return next(folder / name for folder in FOLDERS if (folder / name).is_file()).read_text(encoding="utf-8")
    return TABLE["models"][name]


def made(text: str, edits: Sequence[Sequence[str]]) -> str:
    parts = TABLE["parts"]
    edits = [(filled(old, parts), filled(new, parts)) for old, new in edits]
    return filled(replaced(filled(text, parts), edits), parts)


def numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def mounted(text: str, axis: Sequence[float], degrees: float, pos: Sequence[float] = (0, 0, 0)) -> str:
    """Put an MJCF on a mount."""
    half, unit = np.radians(degrees) / 2.0, np.array(axis, float) / np.linalg.norm(axis)
    quat = numbers([np.cos(half), *(np.sin(half) * unit)])
    opened = f'<worldbody><body name="mount" pos="{numbers(pos)}" quat="{quat}">'
    return text.replace("<worldbody>", opened).replace("</worldbody>", "</body></worldbody>")


def converted(text: str, length: float = 1.0, mass: float = 1.0, mirror: float = 1.0) -> str:
    root = ElementTree.fromstring(text)
    sign = np.array([1.0, mirror, 1.0])
    for element in root.iter():
        for key, factors in (("xyz", mirror * sign if element.tag == "axis" else length * sign), ("value", mass)):
            if key in element.attrib:
                element.set(key, numbers(np.atleast_1d(factors * np.array(element.attrib[key].split(), float))))
        for key in element.attrib if element.tag == "inertia" else ():
            odd = mirror if key in ("ixy", "iyz") else 1.0
            element.set(key, repr(odd * mass * length**2 * float(element.attrib[key])))
    return ElementTree.tostring(root, encoding="unicode")


def renamed(text: str) -> str:
    found = dict.fromkeys(re.findall(r'name="(\w+)"', text))
    names = {name: f"part{i}" for i, name in enumerate(found) if name != "world"}
    return re.sub(r'"(\w+)"', lambda match: f'"{names.get(match[1], match[1])}"', text)


def sides_of(row: Mapping[str, Any], folder: Path) -> list[str]:
    """Write both sides of a row."""
    changes = [key for key in ("mounted", "units", "mirrored", "renamed") if row.get(key)]
    first = written(folder, "a", made(text_of(row["a"]), row.get("edits_a", ())), row.get("beside_a"))
    same = "libraries" in row and not {"b", "edits"} & row.keys()
    text = made(text_of(row.get("b", row["a"])), row.get("edits", ()))
    for key in changes:
        text = CHANGES[key](text, row[key])
    second = first if same else written(folder, "b", text, row.get("beside"), row.get("edits_beside", ()))
    ends = [f"@{library}" for library in row.get("libraries", ())] or ["", ""]
    return [f"{file}{end}" for file, end in zip((first, second), ends, strict=True)]


#: Key of a row -> what it makes of the text of B.
CHANGES: Mapping[str, Callable[[str, Any], str]] = {
    "mounted": lambda text, values: mounted(text, *values),
    "units": lambda text, factors: converted(text, *factors),
    "mirrored": lambda text, _: converted(text, mirror=-1.0),
    "renamed": lambda text, _: renamed(text),
}


def written(folder: Path, name: str, text: str, beside: str | None, edits: Sequence[Sequence[str]] = ()) -> Path:
    ending = "urdf" if "<robot" in text else "xml" if "<mujoco" in text else "toml"
    if beside:
        (folder / f"{name}.loops.toml").write_text(replaced(text_of(beside), edits), encoding="utf-8")
    file = folder / f"{name}.{ending}"
    file.write_text(text, encoding="utf-8")
    return file


def verdict(diagnosis: Any) -> str:
    if diagnosis.same:
        return "same"
    if not diagnosis.found.alike:
        return "other machines"
    return "withheld" if diagnosis.undecided else "differ"


@pytest.mark.parametrize("row", [*cases(TABLE["claim"], KEYS)])
def test_claim(row, tmp_path):
    sides = sides_of(row, tmp_path)
    options = {key: row[key] for key in ("map", "only") if key in row}
    diagnosis = diagnose(*sides, **options)
    facts = diagnosis.found.facts
    check_facts(facts, row)
    check_causes(diagnosis.found, row)
    check_words(diagnosis, row)
    check_rest(diagnosis, row)
    assert verdict(diagnosis) == row.get("verdict", "differ" if facts else "same"), diagnosis.verdict
    assert diagnosis.exit_status == (0 if diagnosis.same else 1)
    assert row.get("agree", True) == all(each.agrees for each in diagnosis.found.witnesses)
    if row.get("back"):
        again = diagnose(*sides[::-1], **options).found.facts
        mirrored = sorted((fact.part, fact.what) for fact in again)
        assert mirrored == sorted((fact.partner or fact.part, fact.what) for fact in facts), told(again)


def check_facts(facts: Sequence[Any], row: Mapping[str, Any]) -> None:
    if "facts" in row:
        assert len(facts) == len(row["facts"]), told(facts)
    for claim in [*row.get("facts", ()), *row.get("among", ())]:
        assert any(fits(fact, claim) for fact in facts), f"{claim}\n{told(facts)}"
    if "kinds" in row:
        assert sorted({fact.what for fact in facts}) == sorted(row["kinds"]), told(facts)


def check_causes(found: Any, row: Mapping[str, Any]) -> None:
    causes = found.causes
    if "causes" in row:
        assert len(causes) == row["causes"], told(found.facts)
    if "lead" in row:
        assert [causes[0].facts[0].part, causes[0].facts[0].what] == row["lead"], told(causes[0].facts)
    for cause, share in zip(causes, row.get("shares", ()), strict=False):
        assert cause.share == pytest.approx(share, abs=2e-3, nan_ok=True)
    slips = [[reason.slip, *reason.values] for reason in found.reasons]
    for claim in row.get("reasons", ()):
        assert any(matches(slip, claim) for slip in slips), slips
    if "explains" in row:
        (slip, *_), *_ = row["reasons"]
        assert [len(reason.facts) for reason in found.reasons if reason.slip == slip] == [row["explains"]]
    if row.get("reasons") == []:
        assert not slips


def check_words(diagnosis: Any, row: Mapping[str, Any]) -> None:
    for text in row.get("notes", ()):
        assert any(text in note for note in diagnosis.notes), diagnosis.notes
    for text in row.get("says", ()):
        assert text in diagnosis.verdict
    for text in row.get("silent", ()):
        assert text not in f"{diagnosis.verdict} {diagnosis.notes}"


def check_rest(diagnosis: Any, row: Mapping[str, Any]) -> None:
    found, partners = diagnosis.found, {a: partner.name for a, partner in diagnosis.found.pair.joints.items()}
    for name, other in row.get("joints", {}).items():
        assert partners.get(name) == other, partners
    for name, how in row.get("how", {}).items():
        assert found.how[name] == how
    if "mobility" in row:
        assert list(found.mobility or ()) == row["mobility"]
    if "fixed" in row:
        proved = found.fix is not None and found.fix.proved
        assert proved == row["fixed"], (diagnosis.not_fixed, found.fix and told(found.fix.left or ()))
    for path, value in row.get("has", {}).items():
        assert same(attrgetter(path)(diagnosis), value)
    for path, bound in row.get("at_most", {}).items():
        assert attrgetter(path)(diagnosis) <= bound
    for path, bound in row.get("at_least", {}).items():
        assert attrgetter(path)(diagnosis) >= bound


#: Numbers of a text that take part in the motion, by what stands before them.
NUMBERS = re.compile(r'(?:xyz|value|pos|mass|i[xyz]{2}|damping|armature|range|lower|upper)="([^"]+)"')


def changed(text: str, at: Random) -> str:
    places = [match.span(1) for match in NUMBERS.finditer(text)]
    while True:
        start, end = at.choice(places)
        words = text[start:end].split()
        i = at.randrange(len(words))
        if float(words[i]) not in (0.0, 1.0):
            words[i] = f"{float(words[i]) * at.uniform(1.07, 1.9):.6g}"
            return text[:start] + " ".join(words) + text[end:]


@pytest.mark.parametrize("model", ["slips-urdf", "slips-mjcf", "slips-geoms"])
@pytest.mark.parametrize("seed", range(20))
def test_a_factor_that_nobody_slips_by_has_no_reason(model, seed, tmp_path):
    text = text_of(model)
    sides = [written(tmp_path, name, each, None) for name, each in (("a", text), ("b", changed(text, Random(seed))))]
    assert not diagnose(*sides).found.reasons
