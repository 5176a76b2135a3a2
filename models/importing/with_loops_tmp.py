from __future__ import annotations
import ast
from dataclasses import replace
import numpy as np
from screwgauge.models.readings.reading import ClosureReading
from screwgauge.reference.mechanism import GROUND
def at(reading, link):
    if link in reading.bodies: return link, np.eye(4)
    for n,b in reading.bodies.items():
        if link in b.joints: return n, np.eye(4)
    if link in reading.fixed: return GROUND, reading.fixed[link]
    for n,b in reading.bodies.items():
        if link in b.fixed: return n, b.fixed[link]
def with_loops(reading, path):
    d = {l.split(':')[0].strip(): ast.literal_eval(l.split(':',1)[1].strip()) for l in path.read_text().splitlines() if ':' in l}
    c = {}
    for i,((a,b),t) in enumerate(zip(d['closed_loop'], d['type'])):
        c[f'loop{i+1}'] = ClosureReading('weld' if t=='6d' else 'point', *at(reading,a), *at(reading,b))
    return replace(reading, closures=c, actuators={n:(n,1.0) for n in d['name_mot']})
