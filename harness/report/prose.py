"""What the report says in words: how engines were compared, what they share, where the result ends."""

from __future__ import annotations

HOW = """\
Every engine reads its own model file and closes its own loops from the independent coordinates and their
two derivatives; no engine sees another's result. Every pair of engines is compared; none counts as the
truth but the engine of that name, if it ran: balls of high precision that provably hold every value.

**Scaled error** of a pair, per quantity and unit: `max_t |a - b| / max(S, 1e-6 S0)`. S is the largest
magnitude of the truth if it ran, else of the first engine, over all components of that unit and all
samples. S0 is the mechanism's own measure of that unit (1 rad, L, sqrt(g/L), sqrt(g L), g/L, g, M g, M g
L; L the largest distance in the description, M the total mass, g = 9.81 m/s²), so that a quantity that is
zero throughout is not divided by its own rounding. **Digits** are -log10 of it, 17 at most. A value that
is not a number is a failure.

**Judge residuals** need no second engine: closure of the loops, its rate and acceleration; motions of the
bodies against those of the joints; Newton-Euler equations of each body; power balance; virtual work. Each
is scaled by the magnitudes in its own equation.

**Forces that the mechanics leaves open** (more actuators than freedoms) are compared under the rule named
in the table. Where *unique* says no, agreement means the same forces under the same rule, not the only
possible ones.

**What engines share.** Kinematics, inverse dynamics, Jacobians and their drift terms are each engine's
own. Not independent are: the numpy linear algebra of the closure (Newton steps, rates, accelerations) and
of the projection onto the actuators; the reading of the joint angles of the joints where loops are cut;
and the one description of the mechanism from which all model files are written. A mistake in one of these
may show in no pair. The judge checks the equations behind the first, the model check the files; the
angles rest on tests."""

LIMITATIONS = (
    "Agreement is shown at the samples, not between them, and only on this trajectory.",
    "Errors are measured against the largest component of a quantity: a component a thousand times smaller "
    "has three digits less.",
    "Everything but the engine truth is double precision. Near a singular pose digits are lost in proportion "
    "to the condition number, in every engine alike.",
    "Engines that agree can be wrong together: in the description, in the motion, or in what they share.",
    "Joints are ideal and bodies rigid: no friction, clearance, contact or elasticity is compared.",
    "Run times are of this machine and this run; they say nothing about an engine's accuracy per second.",
    "Plots are thinned to what a screen shows, without losing a peak: differences are the largest of each "
    "stretch of samples. The tables use every sample that both engines solved.",
)

INTEGRATED = """\
Every engine reads its own model file, closes its own loops and integrates the motion from the same start
under the same forces; no engine sees another's result. `screw` integrates the independent coordinates and
follows the closed poses on one branch; the others integrate all coordinates of their open trees under
constraints and are brought back onto the closed loops at the samples. Observables follow from the joint
coordinates of each engine by the description. **reference** is a known solution, read from a file.

**Scaled error** of a pair, per quantity and unit: `max_t |a - b| / max(S, 1e-6 S0)`. S is the largest
magnitude of the first engine over all components of that unit and all samples, S0 the mechanism's own
measure of that unit. **Digits** are -log10 of it, 17 at most.

**Tolerance.** An integration with the tolerance rtol for a step leaves an error of rtol times a growth
that the motion decides: up to 160 on the established problems that are smooth, more through singular
poses. Two motions agree where they differ by less than a thousand times the larger of rtol and atol, or by
less than what the scene says.

**Judge residuals** need no second engine: closure of the loops, its rate and acceleration; and the balance
of energy: kinetic energy, that of gravity and springs, less what motors, loads and dampers have put in
since the start, measured by the largest of these parts."""

INTEGRATED_LIMITATIONS = (
    "Agreement is shown at the samples and only for this start; a chaotic motion would lose digits with time.",
    "The same integrators of scipy advance all engines: a mistake of theirs shows only against the reference "
    "and in the balance of energy.",
    "An engine that stops early is compared where it came to, and has a row that says so.",
    *LIMITATIONS[2:],
)
