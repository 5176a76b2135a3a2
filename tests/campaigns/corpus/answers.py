from pathlib import Path
from time import process_time

from campaigns.corpus.parts import Parts
from campaigns.corpus.planted import Planted, Site
from campaigns.corpus.poses import EYE
from campaigns.corpus.scrambled import Scrambled
from campaigns.corpus.sentences import Said, said_by

import screwgauge


def diagnosed(a: Path, b: Path) -> tuple[Said, float]:
    begin = process_time()
    try:
        said = said_by(screwgauge.diagnose(a, b))
    except screwgauge.ScrewgaugeError as error:
        said = Said("REFUSED", clean(str(error), a, b))
    except Exception as error:  # a crash is a row, too, and a wrong one
        said = Said("CRASHED", f"{type(error).__name__}: {error}")
    return said, process_time() - begin


def clean(text: str, *files: Path) -> str:
    """Without places of this machine."""
    for file in files:
        text = text.replace(f"{file.parent}/", "").replace(str(file.parent), "")
    return text


def site(planted: Planted, a: Parts, done: Scrambled) -> Site:
    names = set[str]()
    for item in (planted.item, *planted.also):
        kind, _, name = item.partition(" ")
        if name:
            names |= {name, done.called(kind, name)}
    at = planted.at
    if not at:
        return Site(planted, frozenset(names))
    axes = [EYE, done.axes(at).T, a.world(at)]
    near = next((a.before(j) for j in a.joints() if a.owner(j) == at), None)
    if near is not None:  # a placement may be told in the axes that it is written in
        before = a.world(near).T @ a.world(at) if near else a.world(at)
        axes += [before, done.axes(near).T @ before]
    carrier = next((a.carrier(b) for b in a.bodies() if b.get("name") == at), at)
    if carrier != at:  # or in those of what carries it
        held = a.world(carrier).T @ a.world(at)
        axes += [held, done.axes(carrier).T @ held]
    return Site(planted, frozenset(names), tuple(axes))
