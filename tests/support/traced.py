"""Programs traced from the solver, and their machine code."""

from screwgauge.engines.screw.programs import Arcs
from screwgauge.reference.traced import native
from screwgauge.reference.traced.derivatives import adjoints, substitute, tangents
from screwgauge.reference.traced.function import Function
from screwgauge.reference.traced.native import Native, machine_code
from screwgauge.reference.traced.program import Lanes, Pool, program, reduce_program
from screwgauge.reference.traced.trace import Factors, Node, NotTraceableError, Trace, apply
