"""Files that commands read, whole and broken at random: input of others, and what earlier commands have left."""

import copy
import json
import os
import random
import tomllib
from collections.abc import Callable
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import fuzz
import numpy as np
import pandas as pd

import screwgauge
from screwgauge.report.folder import MANIFEST
from support.gate import PAGE
from support.mechanism import load_mechanism, mechanism_path
from support.models import model_texts

MECHANISMS = ("slider-crank", "five-bar", "bennett")
#: What a check leaves.
REPORT = tuple(f"out/{name}" for name in ("report.md", "report.html", "check.json", "environment.json", MANIFEST))
#: What no entry should be, beside what `fuzz` puts there.
HOSTILE: tuple[Any, ...] = (
    *(each for each in fuzz.BAD if each != 16**5000),  # which json cannot write
    *("\x00", "\ud800", "\x1b[2J", "../../x", "/etc/passwd", "x" * 300, "<<", "on", "59:59:59", None, 10**400, -1e400),
    *([[[[[[[[[[[[[]]]]]]]]]]]]], {"a": {"a": {"a": {"a": {}}}}}, ["x"] * 2000),
)
#: What may be in the place of a file.
SPECIAL: dict[str, Callable[[Path], object]] = {
    "fifo": os.mkfifo,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "random": lambda path: path.symlink_to("/dev/urandom"),
    "circle": lambda path: path.symlink_to(path),
    "nowhere": lambda path: path.symlink_to("no/such/file"),
    "folder": lambda path: path.mkdir(),
    "huge": lambda path: (path.touch(), os.truncate(path, 10**11)),
    "unreadable": lambda path: (path.write_bytes(b"x"), path.chmod(0)),
}
_LETTERS = b"abcdefghij"
#: Whole texts that are bad in any format.
TEXTS = (
    b"",
    b"\0",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"9" * 5000,
    b"x = " + b"1" * 10**6,
    b"[" * 100_000,
    b"{" * 100_000,
    b"{" + b'"a":{' * 5000,
    b"<a>" * 100_000,
    b"a." * 50_000 + b"a = 1",
    b"[" + b".".join([b"a"] * 2000) + b"]",
    b"- " * 5000,
    b"".join(b"%c: &%c [*%c, *%c]\n" % (c + 1, c + 1, c, c) for c in _LETTERS),
    b"a: &a {x: y}\n" + b"".join(b"%c: &%c {<<: [%s]}\n" % (c + 1, c + 1, b"*%c, " % c * 10) for c in _LETTERS),
    *(b"a: !!int ''", b"a: !!float ''", b"a: !!bool x", b"a: !!timestamp x", b"a: 59:59:59"),
    b"PAR1" * 3,
    b"t,x\n" + b"," * 10**6,
    b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
)


class Kind(NamedTuple):
    """A way to use the command line.

    Attributes:
        command: Its words; more of them are added at random.
        targets: Names of files that may be broken.
        further: Words that may be added, each of them a group.
    """

    command: tuple[str, ...]
    targets: tuple[str, ...]
    further: tuple[tuple[str, ...], ...] = ()


OUT = ("--out", "out")
KINDS = {
    "import": Kind(
        ("import", "model.urdf", "--out", "out/x.toml"),
        ("model.urdf", "model.loops.toml"),
        (("--floating",), ("--reader", "mujoco"), ("--reader", "yourdfpy")),
    ),
    "import-mjcf": Kind(("import", "model.xml", "--out", "out/x.toml"), ("model.xml",), (("--reader", "pinocchio"),)),
    "robot-yaml": Kind(("import", "frames.urdf", "--loops", "robot.yaml", "--out", "out/x.toml"), ("robot.yaml",)),
    "diagnose": Kind(
        ("diagnose", "model.urdf", "model.xml", "--limit", "20", *OUT),
        ("model.urdf", "model.xml", "map.toml", "model.loops.toml"),
        (
            ("--json",),
            ("--map", "map.toml"),
            ("--loops", "model.loops.toml"),
            ("--fix", "out/fixed.xml"),
        ),
    ),
    "folder": Kind(
        ("check", ".", *OUT),
        ("scene.toml", "mechanism.toml", "motion.csv", "more.toml", "model.urdf", "model.xml", "model.loops.toml"),
        (("--json",), ("--smoke",), ("--junit", "out/junit.xml")),
    ),
    "baseline": Kind(("check", "scene.toml", "--baseline", "baseline.json", *OUT), ("baseline.json",), (("--json",),)),
    "tolerances": Kind(("check", "scene.toml", "--tolerances", "tolerances.toml", *OUT), ("tolerances.toml",)),
    "tables": Kind(
        ("run", "tables.toml", *OUT), ("mine.csv", "mine.parquet", "tables.toml"), (("--json",), ("--samples",))
    ),
    "manifest": Kind(("check", "scene.toml", *OUT), (*[f"out/{MANIFEST}"] * 4, "out/report.md", "out/check.json")),
}


@lru_cache
def whole(name: str) -> dict[str, bytes]:
    mechanism = load_mechanism(name)
    files = fuzz.whole(name)
    texts = model_texts(mechanism, include=frozenset({"yaml"}))
    named = next(iter(mechanism.bodies)).name
    more = {
        "frames.urdf": texts[f"{name}.urdf"],
        "robot.yaml": texts[f"{name}.yaml"] + f"joint_name: []\njoint_type: []\nmore: [1, 2.5, null, {named}]\n",
        "map.toml": f'"{named}" = "{named}"\n',
        "more.toml": mechanism_path(name).read_text(encoding="utf-8"),
        "tolerances.toml": "actuator_force = 1e-6\njoint_position = 1e-9\n",
    }
    files |= {file: text.encode() for file, text in more.items()}
    with TemporaryDirectory() as folder:
        before = Path.cwd()
        for file, data in files.items():
            (Path(folder) / file).write_bytes(data)
        os.chdir(folder)
        try:
            return files | _left()
        finally:
            os.chdir(before)


def _left() -> dict[str, bytes]:
    found = screwgauge.check("scene.toml")
    found.write_baseline("baseline.json")
    kept = {"baseline.json": Path("baseline.json").read_bytes()}
    PAGE.write(found, Path("out"))
    kept |= {f"out/{path.name}": path.read_bytes() for path in Path("out").iterdir() if path.is_file()}
    results = screwgauge.run(screwgauge.load_scene("scene.toml"), ["screw"])
    columns = {"t": results.times}
    for quantity in ("joint_acceleration", "actuator_force"):
        names = results.components(quantity)
        columns |= {f"{quantity}/{x}": v for x, v in zip(names, results.values(quantity).T, strict=True)}
    table, parquet = pd.DataFrame(columns), BytesIO()
    table.to_parquet(parquet)
    said = tomllib.loads(Path("scene.toml").read_text(encoding="utf-8"))
    said["tables"] = {"mine": "mine.csv", "other": {"file": "mine.parquet", "error": {"actuator_force": 1e-9}}}
    kept |= {"mine.csv": table.to_csv(index=False).encode(), "mine.parquet": parquet.getvalue()}
    return kept | {"tables.toml": fuzz.document(said).encode()}


class Case(NamedTuple):
    """A folder in which one file is broken, and a command.

    Attributes:
        special: What is in the place of the file, of `SPECIAL`; empty for its data.
        done: What was done to it.
    """

    kind: str
    mechanism: str
    command: tuple[str, ...]
    file: str
    data: bytes
    special: str
    done: str

    def write(self, folder: Path) -> None:
        of_reports = self.kind == "manifest"
        for file, data in {**whole(self.mechanism), self.file: self.data}.items():
            path = folder / file
            if file.startswith("out/") and file != self.file and not (of_reports and file in REPORT):
                continue
            path.parent.mkdir(exist_ok=True)
            if file == self.file and self.special:
                SPECIAL[self.special](path)
            else:
                path.write_bytes(data)

    def __str__(self) -> str:
        return f"{self.kind}: screwgauge {' '.join(self.command)} on {self.mechanism}; {self.file}: {self.done[:300]}"


def drawn(kind: str, seed: int) -> Case:
    """The case of a seed."""
    chance, how = random.Random(f"{kind} {seed}"), KINDS[kind]
    mechanism, file = chance.choice(MECHANISMS), chance.choice(how.targets)
    further = [words for words in how.further if chance.random() < 0.3]
    command = (*how.command, *(word for words in further for word in words))
    data, special = whole(mechanism)[file], ""
    draw = chance.random()
    if draw < 0.06:
        special = done = chance.choice(list(SPECIAL))
    elif draw < 0.14:
        data = chance.choice(TEXTS)
        done = f"became {data[:60]!r}"
    elif draw < 0.3:
        data, done = fuzz.mutated_bytes(data, chance)
    else:
        data, done = _mutated(file, data, chance)
    return Case(kind, mechanism, command, file, data, special, done)


def _mutated(file: str, data: bytes, chance: random.Random) -> tuple[bytes, str]:
    text = "" if file.endswith(".parquet") else data.decode()
    if file.endswith(".json"):
        table, done = mutated(json.loads(text), chance)
        return json.dumps(table).encode(), done
    if file.endswith(".toml"):
        table, done = mutated(tomllib.loads(text), chance)
        return fuzz.document(table if isinstance(table, dict) else {"x": table}).encode("utf-8", "surrogatepass"), done
    if file.endswith(".yaml"):
        entries = {key: json.loads(value) for key, _, value in _pairs(text)}
        table, done = mutated(entries, chance)
        if not isinstance(table, dict):
            return json.dumps(table).encode(), done
        return "\n".join(f"{key}: {json.dumps(value)}" for key, value in table.items()).encode("utf-8", "replace"), done
    if file.endswith(".parquet"):
        return _mutated_parquet(data, chance)
    if file.endswith(".md"):
        return data + b"\nworked on\n", "worked on"
    text, done = (fuzz.mutated_csv if file.endswith(".csv") else fuzz.mutated_xml)(text, chance)
    return text.encode(errors="surrogatepass"), done


def _pairs(text: str) -> list[tuple[str, str, str]]:
    lines = (line.partition(": ") for line in text.splitlines() if not line.startswith(("#", "more")))
    return [*lines]


def mutated(table: Any, chance: random.Random) -> tuple[Any, str]:
    places = list(fuzz.places(table))
    if not places or chance.random() < 0.05:
        return (found := chance.choice(HOSTILE)), f"became {found!r:.60}"
    result, (*parents, last) = copy.deepcopy(table), chance.choice(places)
    node = result
    for key in parents:
        node = node[key]
    how = chance.choice(["delete", "replace", "replace", "replace", "rename", "double"])
    if how in ("rename", "double") and isinstance(node, dict):
        name = chance.choice([f"{last}s", *(x for x in HOSTILE if isinstance(x, str))])
        node[name] = node.pop(last) if how == "rename" else node[last]
        return result, f"{[*parents, last]} {how}d to {name!r:.60}"
    if how == "delete":
        del node[last]
        return result, f"{[*parents, last]} deleted"
    node[last] = copy.deepcopy(chance.choice(HOSTILE))
    return result, f"{[*parents, last]} = {node[last]!r:.60}"


def _mutated_parquet(data: bytes, chance: random.Random) -> tuple[bytes, str]:
    table, text = pd.read_parquet(BytesIO(data)), BytesIO()
    column, row = chance.choice(list(table)), chance.randrange(len(table))
    how = chance.choice(["cell", "cell", "cell", "column", "rename", "drop", "empty", "type", "many"])
    if how == "cell":
        table[column] = table[column].astype(object)
        table.at[row, column] = chance.choice([x for x in HOSTILE if not isinstance(x, dict)])
    elif how == "column":
        table[column] = [chance.choice([3, None, "x", 1.5])] * len(table)
    elif how == "rename":
        table = table.rename(columns={column: chance.choice(["x", "", "\u202e", "t", "error"])})
    elif how == "drop":
        table = table.drop(columns=column)
    elif how == "empty":
        table = table.head(0)
    elif how == "type":
        table[column] = pd.Series(np.arange(len(table))).astype(
            chance.choice(["int8", "datetime64[ns]", "bool", "str"])
        )
    else:
        table = pd.concat([table] * 1000, ignore_index=True)
    try:
        table.to_parquet(text)
    except Exception:  # what Parquet cannot hold
        return data[: row * 7 + 11], "cut off"
    return text.getvalue(), f"{how} {column} {row}"
