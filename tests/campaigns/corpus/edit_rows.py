"""Edits drawn by a seed: single ones, half of them after names, order and frames were changed; two or three at once."""

import copy
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from campaigns.corpus import machines, writers
from campaigns.corpus.answers import clean, diagnosed, site
from campaigns.corpus.edit_table import EDITS
from campaigns.corpus.mjcf_frames import CannotError
from campaigns.corpus.mjcf_scrambler import scramble_mjcf
from campaigns.corpus.parts import NoPlaceError, Parts
from campaigns.corpus.planted import Planted
from campaigns.corpus.poses import Random
from campaigns.corpus.scrambled import QUIET, Scrambled
from campaigns.corpus.sentences import Said, first_place, measured, mentions, named, of_item, others
from campaigns.corpus.shares import shares
from campaigns.corpus.urdf_scrambler import scramble_urdf
from campaigns.public import ROBOTS, installed
from campaigns.rows import rows_in_turn

from support.data import data

SEED, SINGLE, MULTIPLE = 32, 500, 100
#: Kinds of edit that torques show, for two or three at once.
SEEN = ("mass", "com", "inertia", "shift", "rpy", "damping")
#: Of two or three edits the largest leads clearly where it has so many times the share of the next.
CLEAR = 2.0
#: Speeds at which it leads [rad/s].
SPEEDS = 1.0, 4.0
PUBLIC = ROBOTS["corpus"]
_GEARED = data("geared.xml")


def own_models(folder: Path) -> dict[str, Path]:
    texts = {"geared.xml": _GEARED}
    rng = np.random.default_rng(SEED)
    for machine in (each.moved(rng) for each in (machines.arm(1), machines.arm(2, 4, 1), machines.tree(3))):
        texts |= {
            f"{machine.name}.urdf": writers.write_urdf(machine)[0],
            f"{machine.name}.xml": writers.write_mjcf(machine),
        }
    for machine in (machines.four_bar(), machines.five_bar(), machines.three_rrr(), machines.delta_balls()):
        texts[f"{machine.name}.xml"] = writers.write_mjcf(machine)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return {name: folder / name for name in texts}


def public_models(packages: dict[str, list[str]]) -> dict[str, Path]:
    found = {}
    for package, files in packages.items():
        with suppress(PackageNotFoundError):
            for file in files:
                parts = Path(file)
                name = parts.parent.name if parts.stem == "robot" else parts.stem
                found[f"{name}{parts.suffix}"] = installed(package, file)
    return found


def single_edits(numbers: Iterable[int], progress: Callable[[str, float], None]) -> pd.DataFrame:
    with TemporaryDirectory(prefix="corpus-") as folder:
        models = own_models(Path(folder)) | public_models(PUBLIC)
        works = [(f"edit {n}", partial(single_edit, n, models, Path(folder))) for n in numbers]
        return pd.DataFrame(rows_in_turn(works, progress))


def single_edit(number: int, models: dict[str, Path], folder: Path) -> dict[str, Any]:
    """Diagnose one edit."""
    kind = [*EDITS][number % len(EDITS)]
    rng = np.random.default_rng([SEED, number])
    scrambled = number // len(EDITS) % 2 == 1
    for name, root, planted in _edited(models, kind, rng):
        try:
            done = said_differently(root, rng) if scrambled else Scrambled(root)
        except CannotError:
            continue
        said, seconds = _asked(plain_copy(models[name], folder) if scrambled else models[name], done.root, folder)
        row = {"id": f"edit{number}", "model": name, "edit": kind, "scrambled": "yes" if scrambled else "no"}
        return {**row, **judged(said, [planted], Parts.read(models[name]), done), "seconds": f"{seconds:.2f}"}
    raise LookupError(f"no model has a place for {kind}")


def _edited(models: dict[str, Path], kind: str, rng: Random) -> Iterator[tuple[str, ET.Element, Planted]]:
    for name in rng.permutation([*models]):
        parts = Parts.read(models[str(name)])
        try:
            planted = EDITS[kind](parts, rng)
        except NoPlaceError:
            continue
        yield str(name), parts.root, planted


def said_differently(root: ET.Element, rng: Random) -> Scrambled:
    """With other names, order and frames.

    Raises:
        CannotError: It has what is not rewritten.
    """
    return scramble_urdf(root, rng, QUIET) if root.tag == "robot" else scramble_mjcf(root, rng, QUIET)


def plain_copy(file: Path, folder: Path) -> Path:
    root = ET.parse(file).getroot()
    rng = np.random.default_rng(0)
    done = scramble_urdf(root, rng, frozenset()) if root.tag == "robot" else scramble_mjcf(root, rng, frozenset())
    plain = folder / f"plain-{file.parent.name}-{file.name}"
    ET.ElementTree(done.root).write(plain, encoding="unicode")
    return plain


def _asked(a: Path, root: ET.Element, folder: Path) -> tuple[Said, float]:
    b = folder / f"edited{a.suffix}"
    ET.ElementTree(root).write(b, encoding="unicode")
    return diagnosed(a, b)


def judged(said: Said, planted: list[Planted], a: Parts, done: Scrambled) -> dict[str, Any]:
    sites = [site(each, a, done) for each in planted]
    right = [measured(of_item(said, each), each) for each in sites]
    more = others(said, sites)
    if not said.rows and not any(mentions(said.first, each.names) for each in sites):
        more = [said.first]  # such as: models of different machines
    found = said.answer == "DIFFER" or (said.answer == "CONVENTIONS" and planted[0].what in ("sign", "placement"))
    return {
        "item": " + ".join(each.item or "model" for each in planted),
        "amount": " + ".join(size_of(each) for each in planted),
        "answer": said.answer,
        "found": _yes(found),
        "named": _yes(found and named(said, sites[0])),
        "magnitude": _yes(found and all(size for size, _ in right)),
        "sign": _yes(found and all(way for _, way in right)),
        "rows": len(said.rows),
        "others": len(more),
        "first": said.first[:300],
        "other": clean(" | ".join(more))[:200],
    }


def size_of(planted: Planted) -> str:
    """The change in SI units."""
    if planted.step is None:
        return "-"
    step = np.asarray(planted.step, dtype=float)
    return f"{float(step):+.4g}" if step.ndim == 0 else "(" + " ".join(f"{x:+.3g}" for x in step) + ")"


def _yes(truth: bool) -> str:
    return "yes" if truth else "no"


def multiple_edits(numbers: Iterable[int], progress: Callable[[str, float], None]) -> pd.DataFrame:
    with TemporaryDirectory(prefix="corpus-") as folder:
        models = own_models(Path(folder)) | public_models(PUBLIC)
        models = {name: file for name, file in models.items() if _turns(Parts.read(file))}
        works = [(f"edits {n}", partial(multiple_edit, n, models, Path(folder))) for n in numbers]
        return pd.DataFrame(rows_in_turn(works, progress))


def _turns(parts: Parts) -> bool:
    loops = parts.root.find("equality") is not None
    return not loops and not any(parts.slides(joint) for joint in parts.joints())


def multiple_edit(number: int, models: dict[str, Path], folder: Path) -> dict[str, Any]:
    rng = np.random.default_rng([SEED, 1000 + number])
    while True:
        name = str(rng.choice([*models]))
        kinds = [str(k) for k in rng.choice(SEEN, 2 + number % 2, replace=False)]
        first = Parts.read(models[name])
        root = copy.deepcopy(first.root)
        try:
            planted, alone = _together(root, first.root, kinds, rng)
            each, fast = (shares(first.root, alone, speed) for speed in SPEEDS)
            done = said_differently(root, rng) if number % 4 > 1 else Scrambled(root)
        except (NoPlaceError, CannotError, ValueError):
            continue
        order = [int(i) for i in np.argsort(-each)]
        clear = all(some[order[0]] > CLEAR * max(some[i] for i in order[1:]) for some in (each, fast))
        if clear and len({p.item for p in planted}) == len(planted):
            break
    said, seconds = _asked(plain_copy(models[name], folder) if number % 4 > 1 else models[name], done.root, folder)
    ranked = [planted[i] for i in order]
    row = judged(said, ranked, first, done)
    names = [site(p, first, done).names for p in ranked]
    text = " ".join([said.first, *(r.text for r in said.rows)])
    places = [first_place(said.first, some) for some in names]
    return {
        "id": f"edits{number}",
        "model": name,
        "edit": " + ".join(p.kind for p in ranked),
        "scrambled": _yes(number % 4 > 1),
        "shares": " ".join(f"{each[i]:.3f}" for i in order),
        **row,
        "leads": _yes(row["named"] == "yes" and places[0] == min(places)),
        "all": _yes(all(mentions(text, some) for some in names)),
        "seconds": f"{seconds:.2f}",
    }


def _together(
    root: ET.Element, original: ET.Element, kinds: list[str], rng: Random
) -> tuple[list[Planted], list[ET.Element]]:
    planted, alone = [], []
    for kind in kinds:
        seed = int(rng.integers(2**32))
        planted.append(EDITS[kind](Parts(root), np.random.default_rng(seed)))
        one = copy.deepcopy(original)
        EDITS[kind](Parts(one), np.random.default_rng(seed))
        alone.append(one)
    return planted, alone
