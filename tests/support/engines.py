"""Problems, engines that answer them, and answers."""

from __future__ import annotations

from screwgauge.engines import registry
from screwgauge.engines.registry import ENGINES, GROUP, Engine, Model, check_engines, engines, get_engine
from screwgauge.engines.screw import model as screw
from screwgauge.problem import ModelFiles, Problem, Progress, quiet
from screwgauge.solution import REFERENCE, Clock, Cost, Failure, Solution, Timing, Values, common_rows
from screwgauge.study.apart import apart
from screwgauge.study.ask import ask, in_turn, silent, solve
from screwgauge.study.method import Method
from screwgauge.study.run import run as studied
