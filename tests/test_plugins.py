import hashlib
import inspect
from pathlib import Path

import pytest

from screwgauge import plugins
from support import frozen_engine
from support.command import loaded_after, printed_by

#: Libraries that take longer to import than all of the package.
HEAVY = ("pinocchio", "mujoco", "pandas", "scipy", "llvmlite", "flint", "exudyn", "pydrake")


def test_import_loads_no_library_of_an_engine():
    assert loaded_after("import screwgauge.plugins", *HEAVY) == set()


def test_import_loads_the_modules_of_trees_only_when_they_are_asked_for():
    code = (
        "import sys, screwgauge.plugins as kit\n"
        "print(any(name.startswith('screwgauge.engines.tree.') for name in sys.modules))\n"
        "from screwgauge.plugins import OpenTree\n"
        "print(OpenTree is sys.modules['screwgauge.engines.tree.protocol'].OpenTree)\n"
    )
    assert printed_by(code).split() == ["False", "True"]


@pytest.mark.parametrize("name", plugins.__all__)
def test_every_name_is_explained(name):
    assert f"`{name}`" in plugins.__doc__
    value = getattr(plugins, name)
    if inspect.isclass(value) or inspect.isroutine(value):
        assert (value.__doc__ or "").strip()


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no_such_name"):
        _ = plugins.no_such_name


def test_the_frozen_engine_is_as_it_was():
    text = Path(frozen_engine.__file__).read_bytes()
    assert hashlib.sha256(text).hexdigest() == "d19002753a1e86bdc29d5613f2d39b8aa8ca6769430b27c7c63e203b3f4b81c6"
