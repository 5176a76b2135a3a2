"""Pages of the documentation: what they show, and those that are made of the program.

``PYTHONPATH=tests python -m support.guide`` writes the pages that are made.
"""

import argparse
import ast
import inspect
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import screwgauge
from screwgauge.cli import DIAGNOSE_STATUS, GROUPS, STRESS_STATUS, _parser, main
from screwgauge.engines.features import FEATURES, TASKS
from screwgauge.engines.registry import ENGINES, Engine
from screwgauge.models.catalog import load_mechanism, mechanism_names, mechanism_tables
from screwgauge.models.content import kinds
from screwgauge.quantities import NUMBER_TYPES, QUANTITIES
from screwgauge.reference.mechanism import KINDS
from screwgauge.scene.keys import TABLES
from screwgauge.scene.read import load_scene, scene_names
from support.data import data

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / "harness/guide"
ROOMS = ("models", "harness/scenes", "harness/casebook", "reference", "reports")
MADE = "<!-- Made by `PYTHONPATH=tests python -m support.guide`. -->"
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NAMED = re.compile(r"`([\w/-]+\.(?:toml|csv|py|xml|usda))`")


def pages() -> dict[str, str]:
    files = [
        ROOT / "README.md",
        ROOT / ".github/CONTRIBUTING.md",
        *sorted(GUIDE.glob("*.md")),
        *(ROOT / room / "README.md" for room in ROOMS),
    ]
    return {str(file.relative_to(ROOT)): file.read_text(encoding="utf-8") for file in files}


# What pages show


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block.

    Attributes:
        before: The paragraph before it.
        file: Name of the file that the paragraph introduces; empty if it introduces none.
    """

    language: str
    text: str
    before: str
    file: str


def blocks(text: str) -> Iterator[Block]:
    """Those of a page, in order."""
    end = 0
    for found in FENCE.finditer(text):
        before = text[end : found.start()].strip().split("\n\n")[-1]
        names = [name for name in NAMED.findall(before) if name.endswith(f".{found[1][:4].replace('pyth', 'py')}")]
        yield Block(found[1], found[2], before, names[-1] if names else "")
        end = found.end()


def shown_files() -> dict[str, str]:
    files: dict[str, str] = {}
    for page, text in pages().items():
        for block in blocks(text):
            if block.file:
                assert files.setdefault(block.file, block.text) == block.text, f"{page} shows another {block.file}"
    return files


@dataclass(frozen=True, slots=True)
class Shown:
    shown: str
    printed: str


def carried_out(text: str, folder: Path) -> Iterator[Shown]:
    for name, content in shown_files().items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(content, encoding="utf-8")
    names: dict[str, Any] = {"__name__": "page"}
    printed = ""
    with chdir(folder):
        for block in blocks(text):
            if block.language == "sh":
                printed = "".join(_run(line) for line in block.text.replace("\\\n", " ").splitlines())
            elif block.language == "python" and not block.file:
                exec(compile(block.text.replace("100_000", "1_000"), "page", "exec"), names)
            elif block.language == "text" and printed:
                yield Shown(block.text, printed)


def _run(line: str) -> str:
    """What a command prints; its exit status is 0, or that which its comment says."""
    command, _, comment = line.partition(" #")
    status = int(said[1]) if (said := re.search(r"exit status (\d)", comment)) else 0
    if command.startswith("screwgauge "):
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            got = main(shlex.split(command)[1:])
        assert got == status, f"{line}: exit status {got}\n{out.getvalue()}{err.getvalue()}"
        return out.getvalue() + err.getvalue()
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # python3 is that of an active environment
    env = {**os.environ, "PATH": path}
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False, env=env)
    assert done.returncode == status, f"{line}: exit status {done.returncode}\n{done.stderr}"
    return done.stdout


FACT = re.compile(r"[✓✗] ?[A-Z]*|[A-Za-z.]*\w*_[\w.]+|[A-Za-z]+\.[\w.]*\w|-?\d+(?:\.\d+)?(?:e-?\d+)?|\b[A-Z]{3,}\b")
ROUNDING = 1e-8  # numbers below it, and counts of digits, are rounding: another processor has others


def missing(shown: str, printed: str) -> list[str]:
    """Verdicts, and names and numbers of tables, that a page shows and a command does not print.

    Sentences are not looked at: their wording may change, see `other_wording`.
    """
    verdicts = re.findall(r"^[✓✗] [A-Z]+", shown, re.MULTILINE)
    table = "\n".join(line for line in shown.splitlines() if re.search(r"\S {2,}\S", line))
    facts, numbers = {*FACT.findall(printed)}, [x for x in map(_number, FACT.findall(printed)) if x is not None]
    lost = [fact for fact in FACT.findall(table) if fact not in facts and not _among(fact, numbers)]
    return [*(verdict for verdict in verdicts if verdict not in printed), *lost]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _among(text: str, numbers: list[float]) -> bool:
    if (number := _number(text)) is None:
        return False
    if abs(number) < ROUNDING:
        return any(abs(other) < ROUNDING for other in numbers)
    if re.fullmatch(r"1\d\.\d", text):  # digits of numbers that agree to rounding
        return any(abs(other - number) < 2.0 for other in numbers)
    return any(abs(other - number) <= 1e-9 * abs(number) for other in numbers)


def other_wording(shown: str, printed: str) -> list[str]:
    squeezed = " ".join(printed.split())
    return [piece for piece in re.split(r"\.\.\.|\n", shown) if " ".join(piece.split()) not in squeezed]


# Pages that are made


def made() -> dict[Path, str]:
    texts = {"commands.md": _commands(), "python.md": _python(), "compared.md": _compared(), "builtin.md": _builtin()}
    texts |= {"engines.md": _engines(), "scene-keys.md": _scene_keys()}
    return {GUIDE / name: f"{MADE}\n{text.rstrip()}\n" for name, text in texts.items()}


OF = {"given": " (only given motions)", "simulated": " (only simulations)"}


def _scene_keys() -> str:
    parts = [data("guide/scene-keys.md")]
    for table in TABLES.values():
        parts += [f"## {table['title']}", *([table["about"]] if "about" in table else [])]
        rows = [
            f"| `{key}` | {one.get('unit', '')} | {_default(one)} | {_told(one)} |"
            for key, one in table["keys"].items()
        ]
        parts.append("\n".join(["| key | unit | default | meaning |", "|---|---|---|---|", *rows]))
    return "\n\n".join(parts)


def _told(one: dict[str, Any]) -> str:
    return one["meaning"] + OF.get(one.get("kind", ""), "")


def _default(one: dict[str, Any]) -> str:
    value = one.get("default")
    if value in (None, "", {}, []):
        return ""
    return f"`{json.dumps(value) if one['shape'] in ('names', 'text', 'flag') else str(value).replace(chr(39), '')}`"


def commands() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    (chosen,) = (each for each in _parser()._actions if isinstance(each, argparse._SubParsersAction))
    return dict(chosen.choices)


def _commands() -> str:
    known = commands()
    parts = [data("guide/commands.md")]
    for group, names in GROUPS.items():
        parts.append(f"## {group.capitalize()}")
        for name in names:
            command = known[name]
            what, example = (command.description or "").split("\n\nexample: ")
            shown = [each for each in command._actions if not {*each.option_strings} & {"--help", "--debug", "--force"}]
            shown.sort(key=lambda each: (bool(each.option_strings), "--out" in each.option_strings))
            taken = [each for each in shown if not each.option_strings]
            usage = " ".join(
                f"[{x.metavar or x.dest}{' ...' * (x.nargs == '*')}]" if x.nargs else x.metavar for x in taken
            )
            parts += [f"### {name}", f"`screwgauge {name} {usage}`".replace(" `", "`"), what]
            parts.append(f"```\n{example}\n```")
            parts.append("\n".join(["| argument | meaning |", "|---|---|", *map(_argument, shown)]))
            if command.epilog in (STRESS_STATUS, DIAGNOSE_STATUS):
                parts.append(" ".join(command.epilog.split()).capitalize() + ".")
    return "\n\n".join(parts)


def _argument(action: argparse.Action) -> str:
    names = ", ".join(f"`{name}`" for name in action.option_strings or [action.metavar or action.dest])
    value = f" `{action.metavar}`" if action.option_strings and action.metavar else ""
    choices = f"one of {', '.join(f'`{choice}`' for choice in action.choices)}" if action.choices else ""
    cells = (f"{names}{value}", "; ".join(filter(None, [action.help, choices])))
    return "| {} | {} |".format(*(cell.replace("|", "\\|") for cell in cells))


CONSTRUCTED = ("Limits", "Recorded")  # classes that users make objects of


def _python() -> str:
    head = "Names of the package, each of which is imported on first use: `import screwgauge`."
    parts = ["# Python", head]
    functions = [name for name in screwgauge.__all__ if inspect.isfunction(getattr(screwgauge, name))]
    for title, names in (("Functions", functions), ("Classes", [n for n in screwgauge.__all__ if n not in functions])):
        parts.append(f"## {title}")
        for name in names:
            value = getattr(screwgauge, name)
            signed = name in functions or name in CONSTRUCTED
            parts += [f"### {name}", _signature(f"screwgauge.{name}", value) if signed else "", *_documented(value)]
    return "\n\n".join(filter(None, parts))


def _documented(value: Any) -> list[str]:
    if not inspect.isclass(value):
        return [_docstring(value.__doc__)]
    shown = {getattr(screwgauge, name) for name in screwgauge.__all__}
    homes = [
        home
        for home in value.__mro__
        if home.__module__.startswith("screwgauge") and (home is value or home not in shown)
    ]
    texts = [_docstring(value.__doc__), *(_docstring(home.__doc__) for home in homes[1:])]
    return [*texts, "\n".join(line for home in homes for line in _members(home))]


def _members(home: type) -> list[str]:
    lines = []
    for name, member in sorted(vars(home).items()):
        if name.startswith("_") or not getattr(member, "__doc__", ""):
            continue
        if isinstance(member, property | cached_property):
            lines.append(f"- `.{name}`: {_docstring(member.__doc__, '  ')}")
        elif inspect.isfunction(member):
            lines.append(f"- {_signature('.' + name, member)}: {_docstring(member.__doc__, '  ')}")
    return lines


def _signature(name: str, value: Any) -> str:
    """Parameters with the defaults that are written out there; others may depend on the machine and are dots."""
    (node,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(value))).body
    written = {ast.unparse(each) for each in ast.walk(node) if isinstance(each, ast.Constant)}
    parts, keywords = [], False
    for each in inspect.signature(value).parameters.values():
        if each.name == "self":
            continue
        if each.kind is each.KEYWORD_ONLY and not keywords:
            parts, keywords = [*parts, "*"], True
        keywords |= each.kind is each.VAR_POSITIONAL
        star = {each.VAR_POSITIONAL: "*", each.VAR_KEYWORD: "**"}.get(each.kind, "")
        default = text if (text := repr(each.default)) in {*written, "()"} else "..."
        parts.append(f"{star}{each.name}" + ("" if each.default is each.empty else f"={default}"))
    return f"`{name}({', '.join(parts)})`"


def _docstring(text: str | None, indent: str = "") -> str:
    """As Markdown: sections are lists."""
    lines, out = inspect.cleandoc(text or "").replace("``", "`").splitlines(), []
    section = ""
    for line in lines:
        if re.fullmatch(r"(Args|Attributes|Raises|Returns|Yields):", line):
            section = line[:-1]
            out += ["", f"*{section}*", ""] if section in ("Args", "Attributes") else [""]
        elif section in ("Args", "Attributes") and (found := re.match(r"    ([\w, *]+): (.*)", line)):
            out.append(f"- `{found[1]}`: {found[2]}")
        elif section in ("Returns", "Raises", "Yields") and line.strip():
            out.append(f"{section}: {line.strip()}" if section else line.strip())
            section = f"{section}+"
        else:
            out.append(f"  {line.strip()}" if section in ("Args", "Attributes") and line.strip() else line.strip())
    whole = re.sub(r"\n{3,}", "\n\n", "\n".join(out).strip())
    return re.sub(r"\n(?=.)", f"\n{indent}", whole) if indent else whole


def _builtin() -> str:
    lines = ["| name | mechanism | degrees of freedom, loops | source, known result |", "|---|---|---|---|"]
    for name in mechanism_names():
        one, known = load_mechanism(name), mechanism_tables(name).get("source", "")
        counts = f"{len(one.independent)}, {len(one.joints) - len(one.bodies)}"
        lines.append(f"| `{name}` | {one.title} | {counts} | {known} |")
    scenes = ["| name | scene | motion | description |", "|---|---|---|---|"]
    for name in scene_names():
        scene = load_scene(name)
        motion = f"{'simulation' if scene.simulated else 'given'}, {scene.t[-1]:g} s"
        scenes.append(f"| `{name}` | {scene.title} | {motion} | {' '.join(scene.description.split())} |")
    return "\n\n".join([data("guide/built-in.md"), "\n".join(lines), "## Scenes", "\n".join(scenes)])


def _engines() -> str:
    known = [*ENGINES.values()]
    own = [f"extra `{one.extra}`" if one.extra else "" for one in known]
    parts = [data("guide/engines.md"), _ticks("", {"installed by": own}, known)]
    quantities = {f"`{name}`": [name not in one.lacks for one in known] for name in QUANTITIES if name != "observable"}
    parts += ["## Quantities", _ticks("quantity", quantities, known)]
    taken = [{task.__name__ for task in one.tasks} for one in known]
    tasks = {what: [kind in some for some in taken] for kind, what in TASKS.items()}
    parts += ["## Tasks", _ticks("task", tasks, known)]
    named = [{each: f"`{name}`" for name, each in one.methods.items()} for one in known]
    types = {each: [names.get(each, "-") for names in named] for each in NUMBER_TYPES}
    parts += ["## Number types", _ticks("[number type](tolerances.md#number-types)", types, known)]
    joints = {f"{name}: {what}" if name in KINDS else what: name for name, what in FEATURES.items()}
    known_to = {shown: [name not in one.refuses for one in known] for shown, name in joints.items()}
    parts += ["## Joints and forces", _ticks("joint or force", known_to, known), "## Reasons"]
    words, reasons = {**FEATURES, **TASKS}, dict[tuple[str, str], list[str]]()
    for one in known:
        for name, why in {**one.lacks, **{words[key]: why for key, why in one.refuses.items()}}.items():
            reasons.setdefault((one.name, why), []).append(f"`{name}`" if name in QUANTITIES else name)
    parts.append("\n".join(f"- `{name}`: {', '.join(of)}: {why}" for (name, why), of in reasons.items()))
    return "\n\n".join(parts)


def _ticks(head: str, rows: Mapping[str, Sequence[object]], known: Sequence[Engine]) -> str:
    names = [f"`{one.name}`" for one in known]
    lines = [f"| {' | '.join([head, *names])} |", f"|{'---|' * (len(names) + 1)}"]
    marks = {True: "✓", False: "-"}
    lines += [f"| {' | '.join([name, *(str(marks.get(x, x)) for x in cells)])} |" for name, cells in rows.items()]
    return "\n".join(lines)


def _compared() -> str:
    rows = [f"| {kind.name} | {kind.fate} | {kind.note} | {kind.run} |" for kind in kinds().values()]
    table = ["| content | in a diagnosis | compared by, or reason | in a run |", "|---|---|---|---|", *rows]
    return "\n\n".join([data("guide/compared.md"), "\n".join(table), data("guide/fates.md")])


if __name__ == "__main__":
    for path, content in made().items():
        path.write_text(content, encoding="utf-8")
