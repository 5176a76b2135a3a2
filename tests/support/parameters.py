"""Numbers of machines by name, and derivatives by them without any traced derivative."""

import numpy as np

from screwgauge import Scene
from screwgauge.engines.screw.nominal import COSTS, stack_inputs
from screwgauge.engines.screw.variants import VariantLanes, Variants
from screwgauge.problem import GivenMotion
from screwgauge.reference.closed.assembly_mode import positions
from screwgauge.reference.closed.loops import loop_equations
from screwgauge.reference.graph import layout
from screwgauge.reference.parameters import mechanism_with, numbers
from screwgauge.reference.rotations import Array
from screwgauge.reference.traced.parametric import CHECKS
from screwgauge.reference.traced.trace import OPERATIONS

#: Steps of Newton's method through which complex steps go, and their size.
STEPS, STEP = 6, 1e-30


def gaps_open(scene: Scene, names: tuple[str, ...], step: float = 1e-6) -> dict[str, float]:
    """Number -> how far loops open per change of it, less what motions of the joints close, by central differences."""
    lay, known = layout(scene.mechanism), numbers(scene.mechanism)
    free = loop_equations(lay)
    q = positions(lay, scene.motion.y, scene.t)
    A = free.matrix(q)
    back, opened = np.linalg.pinv(A, rcond=1e-10), dict[str, float]()
    for name in names:
        ends = []
        for sign in (1.0, -1.0):
            changed = mechanism_with(scene.mechanism, {name: known[name] + sign * step})
            system = loop_equations(layout(changed))
            ends.append(system.closing_system(q).residual(q[:, system.y_columns]) / free.unit)
        slope = (ends[0] - ends[1]) / (2.0 * step)
        left = slope - (A @ (back @ slope[..., None]))[..., 0]
        opened[name] = float(np.abs(left).max())
    return opened


def complex_numbers(variants: Variants, motion: GivenMotion, k: int) -> Array:
    """Derivative of all values by number k, by a complex step. Shape (n, m)."""
    machine = variants._machine
    symbols = machine.symbols(variants._known, STEPS)
    program = symbols.program(machine.outputs(symbols))
    poses = machine.at(motion.y, motion.yd, motion.ydd, None)
    values = [*stack_inputs(symbols, poses, variants.nominal).astype(complex)]
    row = len(values) - len(variants.names) + k
    values[row] = values[row] + 1j * STEP
    for op, args in program.code:
        values.append(OPERATIONS[op](*(values[x] if isinstance(x, int) else x for x in args)))
    out = [values[x] if isinstance(x, int) else x + 0j for x in program.outputs]
    return np.array([np.broadcast_to(np.imag(x), len(motion)) for x in out]).T / STEP


def along_a_path(variants: Variants, motion: GivenMotion, given: dict[str, Array], steps: int) -> Array:
    """Values of variants by the same program, its poses followed from the nominal machine in many small changes.

    Shape (V, n, m).
    """
    machine, p = variants._machine, variants._numbers(given)
    poses, (symbols, made) = machine.at(motion.y, motion.yd, motion.ydd, None), variants._program(variants._steps)
    lanes, out = VariantLanes(made, symbols, p.shape[1]), list[Array]()
    for row, q in zip(poses.given, poses.q, strict=True):
        lanes.given[:], lanes.near[:] = row[:, None], q[symbols.near, None]
        lanes.start[:] = q[symbols.predicted, None]
        for share in [*np.linspace(1.0 / steps, 1.0, steps), 1.0]:
            lanes.numbers[:] = variants.nominal[:, None] + share * (p - variants.nominal[:, None])
            lanes.run()
            lanes.start[:] = lanes.out[machine.count + len(CHECKS) :]
        out.append(lanes.out[: machine.count].copy())
    return np.moveaxis(np.array(out), 2, 0)


__all__ = ["COSTS", "along_a_path", "complex_numbers", "gaps_open", "numbers"]
