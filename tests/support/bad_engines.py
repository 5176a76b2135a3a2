"""Engines of another package that crash, or eat all memory, when they are asked."""

from functools import partial

from screwgauge.engines.registry import Engine
from screwgauge.problem import GivenMotion
from support.bad_works import hog, load, segfault

NAMES = ("segfault", "hog")
load_segfault, load_hog = (partial(load, work=work) for work in (segfault, hog))
SEGFAULT, HOG = (
    Engine(name, name, f"{__name__}:load_{name}", frozenset((GivenMotion,)), "screwgauge") for name in NAMES
)
#: Entry points of a package that has them.
PLACES = {name: f"{__name__}:{name.upper()}" for name in NAMES}
