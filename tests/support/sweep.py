"""Sweeps and their draws."""

from screwgauge.reference.mechanism import triangle_excess
from screwgauge.study.sweep.draw import Draw, consistent_bodies
from screwgauge.study.sweep.plan import read_plan
from screwgauge.study.sweep.run import CHUNK, sweep

__all__ = ["CHUNK", "Draw", "consistent_bodies", "read_plan", "sweep", "triangle_excess"]
