"""Terminal output of `screwgauge list` and `screwgauge casebook`."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from screwgauge.casebook.book import CASES as CASEBOOK
from screwgauge.casebook.book import Case, Versions, installed_versions
from screwgauge.engines.registry import Engine, engines
from screwgauge.models.catalog import load_mechanism, mechanism_names
from screwgauge.quantities import QUANTITIES
from screwgauge.report.blocks import Banner, Block, Items, Marked, Table
from screwgauge.report.text import terminal
from screwgauge.scene.read import load_scene, scene_names
from screwgauge.study.bench.stress import CASES


def mechanisms() -> dict[str, str]:
    """Return name -> title of each mechanism; a line with the group's name precedes each group."""
    known = sorted(map(load_mechanism, mechanism_names()), key=lambda one: (one.group, one.name))
    return dict(line for one in known for line in ((f"{one.group}:", ""), (f"  {one.name}", one.title)))


def _methods(engine: Engine) -> Iterator[tuple[str, str]]:
    """Yield the methods of an engine, one for each number type, with an explanation of each."""
    first, *others = engine.methods.items()
    yield first[0], _meaning(engine)
    yield from ((name, f"the same in {precision}") for name, precision in others)


def _meaning(engine: Engine) -> str:
    return engine.meaning if engine.installed else f"{engine.meaning} (pip install {engine.requirement})"


_TABLES: dict[str, Callable[[], dict[str, str]]] = {
    "mechanisms": lambda: mechanisms(),
    "scenes": lambda: {name: load_scene(name).title for name in scene_names()},
    "engines": lambda: dict(line for engine in engines().values() for line in _methods(engine)),
    "quantities": lambda: {name: quantity.meaning for name, quantity in QUANTITIES.items()},
    "cases": lambda: {name: f"{case.title} ({case.span})" for name, case in CASES.items()},
    "discrepancies": lambda: {case.id: case.title for case in CASEBOOK.values()},
}


def listing(what: str | None) -> str:
    """List names, each with a line of explanation, for one kind or for all kinds."""
    tables = {
        name: terminal([Table(("", ""), tuple(_TABLES[name]().items()))]) for name in ([what] if what else _TABLES)
    }
    return tables[what] if what else "\n\n".join(f"{name}\n{text}" for name, text in tables.items())


def blocks(case: Case) -> list[Block]:
    """Show a case with its sentence, measured numbers, versions and links."""
    rows = [(words, case.numbers[name]) for words, name in _NUMBERS if name in case.numbers]
    rows += [(words, "; ".join(map(case.engines_text, some))) for words, some in _measurements(case) if some]
    rows += [("seen with", case.versions)]
    here = installed_versions(case)
    if here is not None and (case.shown or case.not_shown):
        rows.append(("installed", f"{case.engines_text(here)}: {'shown' if case.shows(here) else 'not shown'}"))
    return [
        Banner(Marked(case.sentence), case.id, "note"),
        Table(("", ""), tuple(rows)),
        *([Items(case.links)] if case.links else []),
    ]


def _measurements(case: Case) -> list[tuple[str, tuple[Versions, ...]]]:
    return [("shown with", case.shown), ("not shown with", case.not_shown)]


_NUMBERS = (("result that users get", "symptom"), ("expected result", "expected"), ("after the remedy", "mended"))
