"""Breaks input files at random: each is read and run, or refused in one sentence; nothing else happens.

    python tests/fuzz.py --count 10000 --seed 0    # prints what happened otherwise, and counts

A case is the scene of a small built-in mechanism with a CSV motion and model files of its own, one of its files broken:
an entry, an element or a cell deleted, renamed, replaced, moved or scaled, or bytes changed.
"""

import argparse
import copy
import json
import random
import tempfile
import tomllib
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

import screwgauge
from screwgauge import load_scene
from support.mechanism import load_mechanism, mechanism_path
from support.models import model_texts

MECHANISMS = ("slider-crank", "five-bar", "bennett", "double-cardan")
FORMATS = ("mechanism.toml", "scene.toml", "motion.csv", "model.urdf", "model.xml", "model.loops.toml")
#: What belongs nowhere.
TEXTS = ("", "x", "nan", "1/0", "9**9**9", "((", "__import__('os')", "ground", "1 2", "1e999", "\u202e", "../x", "~")
NUMBERS = (True, 0, -1, 10**30, -1e-320, 1e308, 1e99, float("nan"), float("inf"))
BAD: tuple[Any, ...] = (
    *(*TEXTS, *NUMBERS, "platform", "leg1.q1", "screw", "com", "S", "P"),
    *([], {}, [1, 2], [1, 2, 3], [[1, 2, 3]]),
    *({"x": 1}, {"x": {"y": []}}, [True] * 3, ["a"], [[]], [{}], ["nan"] * 3, [0, 0, 1], [[0, 0, 1]] * 3),
)

#: A whole number that TOML can say in hexadecimal digits, and that Python does not print.
ENDLESS = 16**5000


def toml(value: Any) -> str:
    """A value as inline TOML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, int) and not isinstance(value, bool):
        return hex(value) if value >= 0 else repr(value)  # Python prints no thousands of decimal digits
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def document(table: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {toml(value)}\n" for key, value in table.items())


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def mutate(table: dict[str, Any], chance: random.Random) -> tuple[dict[str, Any], str]:
    result = copy.deepcopy(table)
    *parents, last = chance.choice(list(places(table)))
    node = result
    for key in parents:
        node = node[key]
    how = chance.choice(["delete", "replace", "replace", "replace", "rename"])
    if how == "rename" and isinstance(node, dict):
        node[f"{last}s"] = node.pop(last)
        return result, f"{[*parents, last]} renamed"
    if how == "replace":
        node[last] = copy.deepcopy(chance.choice((*BAD, ENDLESS)))
        return result, f"{[*parents, last]} = {toml(node[last])[:60]}"
    del node[last]
    return result, f"{[*parents, last]} deleted"


def mutated_xml(text: str, chance: random.Random) -> tuple[str, str]:
    root = ET.fromstring(text)
    parent, element = chance.choice([(parent, child) for parent in root.iter() for child in parent])
    name = f"{element.tag} {element.get('name', '')}".strip()
    how = chance.choice(["delete", "double", "rename", "move", "attribute", "attribute", "attribute", "scale", "scale"])
    if how in ("attribute", "scale") and element.attrib:
        key = chance.choice(sorted(element.attrib))
        value = element.attrib.pop(key)
        if how == "scale":
            with_numbers = [_scaled(part, chance) for part in value.split()]
            element.set(key, " ".join(with_numbers))
        elif chance.random() < 0.8:
            element.set(chance.choice([key, key, key, f"{key}s"]), chance.choice(TEXTS + tuple(map(str, NUMBERS))))
        return ET.tostring(root, encoding="unicode"), f"{name}: {key} = {value} became {element.get(key)}"
    if how == "double":
        parent.append(copy.deepcopy(element))
    elif how == "rename":
        element.tag += "s"
    else:
        parent.remove(element)
        if how == "move":
            chance.choice(list(root.iter())).append(element)
    return ET.tostring(root, encoding="unicode"), f"{name}: {how}"


def _scaled(part: str, chance: random.Random) -> str:
    try:
        return repr(float(part) * (1.0 + 10.0 ** chance.uniform(-6, 0)) + chance.choice([0.0, 0.0, 1e-3]))
    except ValueError:
        return part


def mutated_csv(text: str, chance: random.Random) -> tuple[str, str]:
    table = [line.split(",") for line in text.splitlines()]
    i, k = chance.randrange(len(table)), chance.randrange(len(table[0]))
    how = chance.choice(["cell", "cell", "row", "column", "swap"])
    if how == "cell":
        table[i][k] = str(chance.choice(TEXTS + NUMBERS))
    elif how == "row":
        del table[i]
    elif how == "column":
        table = [[cell for j, cell in enumerate(row) if j != k] for row in table]
    else:
        table[i], table[-1] = table[-1], table[i]
    return "\n".join(map(",".join, table)) + "\n", f"{how} {i}, {k}"


def mutated_bytes(data: bytes, chance: random.Random) -> tuple[bytes, str]:
    i, j = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    how = chance.choice(["cut", "lose", "change", "insert", "mark", "latin"])
    changed = {
        "cut": data[:i],
        "lose": data[:i] + data[min(j, i + 20) :],
        "change": data[:i] + bytes([chance.randrange(256)]) + data[i + 1 :],
        "insert": data[:i] + chance.choice([b"\0", b"\xff", b"\n", b"<", b'"', b"]", b"&x;", b"1"]) + data[i:],
        "mark": b"\xef\xbb\xbf" + data,
        "latin": data[:i] + "é".encode("latin-1") + data[i:],
    }
    return changed[how], f"bytes: {how} at {i}"


@lru_cache
def whole(name: str) -> dict[str, bytes]:
    mechanism, scene = load_mechanism(name), load_scene(name)
    few = scene.at(np.linspace(scene.t[0], scene.t[-1], 9)[:4])
    labels, motion = list(mechanism.independent), few.motion
    head = ",".join(["t", *(f"{label}{d}" for d in ("", "d", "dd") for label in labels)])
    rows = np.column_stack([motion.t, motion.y, motion.yd, motion.ydd])
    texts = model_texts(mechanism)
    said = {
        "mechanism": "mechanism.toml",
        "motion": {"csv": "motion.csv"},
        "time": {"times": motion.t[1:3].tolist()},
        "models": {"pinocchio": "model.urdf", "mujoco": "model.xml"},
    }
    files = {
        "mechanism.toml": mechanism_path(name).read_text(encoding="utf-8"),
        "scene.toml": document(said),
        "motion.csv": "\n".join([head, *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n",
        "model.urdf": texts[f"{name}.urdf"],
        "model.xml": texts[f"{name}.xml"],
        "model.loops.toml": texts[f"{name}.loops.toml"],
    }
    return {file: text.encode() for file, text in files.items()}


class Case(NamedTuple):
    mechanism: str
    file: str
    done: str
    data: bytes

    def write(self, folder: Path) -> Path:
        """The path of the scene."""
        for file, data in {**whole(self.mechanism), self.file: self.data}.items():
            (folder / file).write_bytes(data)
        return folder / "scene.toml"

    def __str__(self) -> str:
        return f"{self.mechanism}, {self.file}, {self.done}"


def drawn(seed: int, formats: tuple[str, ...] = FORMATS) -> Case:
    """The case of a seed."""
    chance = random.Random(seed)
    mechanism, file = chance.choice(MECHANISMS), chance.choice(formats)
    data = whole(mechanism)[file]
    if chance.random() < 0.15:
        changed, done = mutated_bytes(data, chance)
        return Case(mechanism, file, done, changed)
    text = data.decode()
    if file.endswith(".toml"):
        table, done = mutate(tomllib.loads(text), chance)
        return Case(mechanism, file, done, document(table).encode())
    text, done = (mutated_csv if file.endswith(".csv") else mutated_xml)(text, chance)
    return Case(mechanism, file, done, text.encode(errors="surrogatepass"))


def outcome(case: Case, folder: Path) -> str:
    """``agree``, ``agree, but``, ``differ``, ``failed``, ``refused``, or ``WRONG`` and what happened."""
    scene = case.write(folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            results = screwgauge.run(load_scene(scene))
        doubts = [text for solution in results.solutions.values() for text in solution.warnings]
        found = "agree" if results.ok else "failed" if results.failures else "differ"
        found += ", but" if results.ok and doubts else ""
        for failure in results.failures.values():
            if failure.reason.startswith(("KeyError", "IndexError", "TypeError", "AttributeError", "AssertionError")):
                return f"WRONG {failure.traceback}"
    except screwgauge.ScrewgaugeError as error:
        found = f"WRONG sentence: {error}" if "\n" in str(error) or not str(error).endswith(".") else "refused"
    except Exception:
        return f"WRONG {traceback.format_exc()}"
    left = {path.name: path.read_bytes() for path in folder.iterdir()}
    return found if left == before else f"WRONG files {sorted({*left} ^ {*before})}"


def attempted(seed: int) -> tuple[Case, str]:
    case = drawn(seed)
    with tempfile.TemporaryDirectory() as folder:
        return case, outcome(case, Path(folder))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    counts: Counter[tuple[str, str]] = Counter()
    with ProcessPoolExecutor() as pool:
        seeds = range(options.seed, options.seed + options.count)
        for seed, (case, found) in zip(seeds, pool.map(attempted, seeds, chunksize=20), strict=True):
            counts[case.file, found.partition(" ")[0] if found.startswith("WRONG") else found] += 1
            if found.startswith("WRONG") or (found == "agree" and case.file.startswith("model.")):
                print(f"{seed}: {case}: {found}", flush=True)
    for (file, found), count in sorted(counts.items()):
        print(f"{file}\t{found}\t{count}")


if __name__ == "__main__":
    main()
