import ast
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

import screwgauge
import screwgauge.models
import screwgauge.reference

TESTS = Path(__file__).parent
PROJECT = TESTS.parent
MOST_MODULES, MOST_LINES, MOST_PARAMETERS = 10, 400, 8
#: Library -> the only places that import it: its engine's, and the second reading of model files.
ROOMS = {
    "mujoco": ("engines/mujoco/", "models/readings/"),
    "pinocchio": ("engines/pinocchio/", "models/readings/"),
    "flint": ("truth/",),
    "exudyn": ("engines/exudyn.py",),
    "pydrake": ("engines/drake.py",),
    "yourdfpy": ("models/readings/",),
}
#: Folders beside each other in the project that are one package when installed.
FOLDERS = {
    "screwgauge": Path(screwgauge.__file__).parent,
    "screwgauge/reference": Path(screwgauge.reference.__file__).parent,
    "screwgauge/models": Path(screwgauge.models.__file__).parent,
}


@pytest.fixture(scope="module")
def laid(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("laid")
    for name, folder in FOLDERS.items():
        below = [other.rpartition("/")[2] for other in FOLDERS if other.startswith(f"{name}/")]
        shutil.copytree(folder, root / name, ignore=lambda at, names, f=folder, b=below: b if Path(at) == f else [])
    return root


@pytest.fixture(scope="module")
def modules(laid) -> dict[str, list[ast.AST]]:
    texts = {path: path.read_text(encoding="utf-8") for path in sorted((laid / "screwgauge").rglob("*.py"))}
    return {str(path.relative_to(laid / "screwgauge")): [*ast.walk(ast.parse(text))] for path, text in texts.items()}


def imported(nodes: list[ast.AST]) -> set[str]:
    names = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return names


def run(laid: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(laid), "PYTHONDONTWRITEBYTECODE": "1", "NO_COLOR": "1"}
    return subprocess.run(
        [sys.executable, *arguments], cwd=laid, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
def test_imports_point_one_way(laid):
    pytest.importorskip("importlinter", reason="import-linter is not installed")
    config = PROJECT / "pyproject.toml"
    code = f"from importlinter.cli import lint_imports; raise SystemExit(lint_imports({str(config)!r}, no_cache=True))"
    done = run(laid, "-c", code)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_no_layer_is_excused():
    linter = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    contract, witness, *_ = linter["contracts"]
    assert linter["exclude_type_checking_imports"]
    assert contract.keys() == {"name", "type", "layers"}  # no ignore_imports
    assert witness.keys() == {"name", "type", "source_modules", "forbidden_modules"}  # not even by a detour
    assert not any("ignore_imports" in each for each in linter["contracts"])
    named = {name.strip() for layer in contract["layers"] for name in layer.replace(":", "|").split("|")}
    top = {f"screwgauge.{path.stem}" for path in FOLDERS["screwgauge"].glob("*.py") if path.stem != "__init__"}
    rooms = {f"screwgauge.{path.parent.name}" for path in FOLDERS["screwgauge"].glob("*/__init__.py")}
    assert named == top | rooms | {"screwgauge.reference", "screwgauge.models"}


def test_no_module_imports_itself_by_a_detour(laid):
    """Circles, also those closed by imports inside functions; what only a type checker imports closes none."""
    pytest.importorskip("grimp", reason="grimp is not installed")
    code = (
        "import grimp\n"
        "graph = grimp.build_graph('screwgauge', exclude_type_checking_imports=True, cache_dir=None)\n"
        "for name in sorted(graph.modules):\n"
        "    print(name, *sorted(graph.find_modules_directly_imported_by(name)))\n"
    )
    done = run(laid, "-c", code)
    assert done.returncode == 0, done.stderr
    needs = {name: others for name, *others in (line.split() for line in done.stdout.splitlines())}
    while free := [name for name, others in needs.items() if not any(other in needs for other in others)]:
        for name in free:
            del needs[name]
    stuck = {name: [other for other in others if other in needs] for name, others in needs.items()}
    assert not stuck, f"circles among {stuck}"


@pytest.mark.slow
@pytest.mark.parametrize("library", ROOMS)
def test_a_library_is_imported_in_its_engine_s_room_only(modules, library):
    users = [path for path, nodes in modules.items() if library in {name.split(".")[0] for name in imported(nodes)}]
    assert users
    assert [path for path in users if not path.startswith(ROOMS[library])] == []
    for room in ROOMS[library]:
        assert any(path.startswith(room) for path in users), f"nothing in {room} needs {library}"


def test_the_package_has_no_reproduction_of_a_library_s_discrepancy(modules):
    told = {path for path, nodes in modules.items() for node in nodes if getattr(node, "id", "") == "Evidence"}
    assert told == set()
    assert {path for path in modules if path.startswith("casebook/")} == {"casebook/__init__.py", "casebook/book.py"}


@pytest.mark.parametrize("engine", ["pinocchio", "mujoco"])
def test_an_engine_loads_scipy_for_simulations_alone(laid, engine):
    """Its import takes longer than a small given motion."""
    pytest.importorskip(engine)
    done = run(laid, "-c", f"import sys, screwgauge.engines.{engine}.model; print('scipy.integrate' in sys.modules)")
    assert done.stdout.strip() == "False", done.stderr


def test_few_modules_stand_outside_rooms():
    assert len([*FOLDERS["screwgauge"].glob("*.py")]) <= MOST_MODULES


def test_modules_are_short(laid):
    lines = {
        str(path.relative_to(laid)): len(path.read_text(encoding="utf-8").splitlines()) for path in laid.rglob("*.py")
    }
    assert {path: n for path, n in lines.items() if n > MOST_LINES} == {}


def test_values_are_quoted_in_complaints_by_one_function(modules):
    """Python's own form of a value has no end, and of a whole number of 5000 digits there is none."""
    quoting = {
        f"{path}:{value.lineno}"
        for path, nodes in modules.items()
        for node in nodes
        if (isinstance(node, ast.Call) and _name(node.func).endswith("Error") and _name(node.func) != "AttributeError")
        or (isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "what")
        for value in ast.walk(node)
        if isinstance(value, ast.FormattedValue) and value.conversion == ord("r")
    }
    assert not quoting


def functions(nodes: list[ast.AST]) -> Iterator[tuple[str, int]]:
    for node in nodes:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            given = node.args
            rest = [name for name in (given.vararg, given.kwarg) if name is not None]
            yield getattr(node, "name", "lambda"), len([*given.posonlyargs, *given.args, *given.kwonlyargs, *rest])


def test_functions_take_few_parameters(modules):
    many = {
        f"{path}: {name}": n for path, nodes in modules.items() for name, n in functions(nodes) if n > MOST_PARAMETERS
    }
    assert many == {}


def test_every_folder_with_modules_is_packaged(laid):
    """One that is not listed is there in an editable installation and missing from the wheel."""
    setup = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]
    found = {".".join(path.parent.relative_to(laid).parts) for path in laid.rglob("*.py") if "guide" not in path.parts}
    packages = {".".join(path.parent.relative_to(laid).parts) for path in laid.rglob("__init__.py")}
    assert set(setup["packages"]) == found == packages
    assert {name.replace("/", ".") for name in FOLDERS} == set(setup["package-dir"])


def _name(function: ast.expr) -> str:
    return getattr(function, "attr", "") or getattr(function, "id", "")


def test_a_relative_bound_is_not_held_open_by_an_absolute_one():
    """`pytest.approx` admits 1e-12 whatever the relative bound, unless told otherwise."""
    texts = {file: file.read_text(encoding="utf-8") for file in TESTS.rglob("*.py")}
    for file, text in texts.items():
        for node in ast.walk(ast.parse(text)) if "approx" in text else ():
            if isinstance(node, ast.Call) and _name(node.func).endswith("approx"):
                bounds = {keyword.arg: keyword.value for keyword in node.keywords}
                rel = bounds.get("rel", ast.Constant(1.0))
                loose = isinstance(rel, ast.Constant) and rel.value >= 1e-6
                assert loose or "abs" in bounds, f"{file.name}:{node.lineno}: add abs=0"


@pytest.mark.slow
def test_every_name_of_the_facade_is_used():
    """What `support` imports is there for tests, so that no linter says what none of them needs any more."""
    trees = {path: [*ast.walk(ast.parse(path.read_text(encoding="utf-8")))] for path in TESTS.rglob("*.py")}
    froms = [node for nodes in trees.values() for node in nodes if isinstance(node, ast.ImportFrom)]
    used = {(node.module, alias.name) for node in froms for alias in node.names}
    for path in (TESTS / "support").glob("*.py"):
        own = {node.id for node in trees[path] if isinstance(node, ast.Name)}
        imports = [node for node in trees[path] if isinstance(node, ast.Import | ast.ImportFrom)]
        lent = {(alias.asname or alias.name).partition(".")[0] for node in imports for alias in node.names}
        idle = {name for name in lent - own if (f"support.{path.stem}", name) not in used}
        assert idle <= {"annotations"}, path.name
