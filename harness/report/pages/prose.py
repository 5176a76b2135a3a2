"""What reports say in words: how things were compared, what engines share, where the result ends."""

from __future__ import annotations

from screwgauge.judging.conditioning import LIMIT

COMPARED = """\
Every engine reads its own model file and closes its own loops from the independent coordinates and their two
derivatives; no engine sees another's result. Every pair of engines is compared; none counts as the truth but the
engine of that name, if it ran: balls of high precision that provably hold every value.

**Scaled error** of a pair, per quantity and unit: `max_t |a - b| / max(S, 1e-6 S0)`. S is the largest magnitude of the
truth if it ran, else of the first engine, over all components of that unit and all samples. S0 is the mechanism's own
measure of that unit (1 rad, L, sqrt(g/L), sqrt(g L), g/L, g, M g, M g L; L the largest distance in the description, M
the total mass, g = 9.81 m/s²), so that a quantity that is zero throughout is not divided by its own rounding.
**Digits** are -log10 of it, 17 at most. A value that is not a number is a failure.

**Judge residuals** need no second engine: closure of the loops, its rate and acceleration; motions of the bodies
against those of the joints; Newton-Euler equations of each body; power balance; virtual work. Each is scaled by the
magnitudes in its own equation.

**Forces that the mechanics leaves open** (more actuators than freedoms) are compared under the rule named in the
table. Where *unique* says no, agreement means the same forces under the same rule, not the only possible ones.

**What engines share.** Kinematics, inverse dynamics, Jacobians and their drift terms are each engine's own. Not
independent are: the numpy linear algebra of the closure (Newton steps, velocities, accelerations) and of the projection
onto the actuators; the reading of the joint angles of the joints where loops are cut; and the one description of the
mechanism from which all model files are written. A mistake in one of these may show in no pair. The judge checks the
equations behind the first, the model check the files; the angles rest on tests."""

LIMITATIONS = (
    "Agreement is shown at the samples, not between them, and only on this trajectory.",
    "Errors are measured against the largest component of a quantity: a component a thousand times smaller has three "
    "digits less.",
    "Everything but the engine truth is double precision. Near a singular pose digits are lost in proportion to the "
    "condition number, in every engine alike.",
    "Engines that agree can be wrong together: in the description, in the motion, or in what they share.",
    "Joints are ideal and bodies rigid: no friction, clearance, contact or elasticity is compared.",
    "Run times are of this machine and this run; they say nothing about an engine's accuracy per second.",
    "Plots are thinned to what a screen shows, without losing a peak: differences are the largest of each stretch of "
    "samples. The tables use every sample that both engines solved.",
)

SIMULATED = """\
Every engine reads its own model file, closes its own loops and integrates the motion from the same start under the same
forces; no engine sees another's result. `screw` integrates the independent coordinates and follows the closed poses on
one branch; the others integrate all coordinates of their open trees under constraints and are brought back onto the
closed loops at the samples. Observables follow from the joint coordinates of each engine by the description.
**reference** is a known solution, read from a file.

**Scaled error** of a pair, per quantity and unit: `max_t |a - b| / max(S, 1e-6 S0)`. S is the largest magnitude of the
first engine over all components of that unit and all samples, S0 the mechanism's own measure of that unit. **Digits**
are -log10 of it, 17 at most.

**Tolerance.** Integrated with a tolerance of rtol for each step, a motion is off by rtol times a growth that depends on
the motion: up to 160 on the established problems that are smooth, more through singular poses. Two motions agree where
they differ by less than a thousand times the larger of rtol and atol, or by less than what the scene says.

**Judge residuals** need no second engine: closure of the loops, its rate and acceleration; and the balance of energy:
kinetic energy, that of gravity and springs, less what motors, loads and dampers have put in since the start, measured
by the largest of these parts."""

SIMULATED_LIMITATIONS = (
    "Agreement is shown at the samples and only for this start; a chaotic motion would lose digits with time.",
    "The same integrators of scipy advance all engines: a mistake of theirs shows only against the reference and in "
    "the balance of energy.",
    "An engine that stops early is compared up to where it stopped, and has a row that says so.",
    *LIMITATIONS[2:],
)

ESTIMATES = f"""\
Estimated relative error of each quantity, from the conditioning of what it was solved from: over the quantity's largest
magnitude, at its worst sample. Poses close to rounding; how much of that reaches a velocity, an acceleration or a force
is extrapolated where a sample is well-conditioned and computed by solving it again at a perturbed pose where it is
ill-conditioned. Above {LIMIT:.0e} a sample is flagged; *no digit* means that none is right."""

SIMULATED_ESTIMATES = f"""\
What rounding may have made of the motion, from the worst conditioned pose that it went through: next to a singular pose
accelerations are off by about eps times the square of the condition, and every later sample has that behind it. The
error of the integration itself is bounded by its tolerances and shown by the energy and the reference. Above
{LIMIT:.0e} a sample is flagged; *no digit* means that none may be right."""

CURVES = """\
Above: the first engine as lines, the others as sparse marks in its colours. Below: for each pair the largest difference
over the components of the panel, with the tolerance where it is one for all."""

POINTS = """\
Every point is one contestant with one setting. **Error** is scaled: the largest difference from the reference over
all components and compared times, over the largest magnitude of that unit. **Run time** is that of the whole call
over the samples that it delivers. Contestants do not all do the same work, and the column `covers` says what each
does: filled marks start from the independent coordinates and close the loops themselves, hollow ones are given the
true joint motion (forward dynamics also the true forces). Compare run times within one kind."""

LEAVING = """\
Quantities are computed only when they are asked for. Each row is one solution of the whole trajectory with less in
it, its run time as a share of everything, and the largest difference of the numbers that remain (over the largest
magnitude of their unit). Without gravity or load only the motion is compared: forces are meant to change. Contacts
are forces, too: where the drawn shapes touch, they enter `mj_inverse`. Models are loaded outside the clock."""

PROTOCOL = """\
- Errors first, times after: errors come from a pass of their own ({samples} compared times), in which no time counts.
- Models are loaded, arrays allocated and true motions read before the clock starts; each contestant has been called
  once by then. A call below 50 ms is made once more right before it is measured.
- All contestants are measured in turn, {rounds} rounds (two if a call lasts half a second, one from five seconds on),
  so that what slows the machine for a while slows all alike. The garbage collector waits meanwhile.
- `bench.csv` has the shortest of the rounds, since disturbances only add; `timings.csv` also the median.
- The clock is `perf_counter_ns`; the row `floor` is an empty loop over the samples under the same clock.
- {threads}
- After {budget} s nothing further begins; what is missing then is marked `cut short`.
- A contestant that raises or returns what is not a number is a row with its reason."""

ONE_THREAD = (
    "BLAS and OpenMP have one thread each, set before numpy is imported: at these matrix sizes more threads cost time, "
    "and how many there are would depend on the machine."
)
MORE_THREADS = (
    "**The number of threads was not fixed**: numpy had been imported before. `screwgauge bench` on the command line "
    "fixes it to one."
)
BENCH_LIMITATIONS = (
    "Run times are of this machine, this Python and this load; the order of magnitude travels, the digits do not.",
    "Contestants in Python loops carry the loop; a C++ program around the same library would not.",
    "Errors are those at the compared times, on this motion.",
    "Forward dynamics is compared in the accelerations of the tree's joints only; cut joints have no coordinate there.",
    "The scaled error of accelerations is large for forward dynamics on nearly static motions: the forces of a "
    "load of 1 kN have to cancel down to accelerations of 0.1.",
)

SIMULATED_PROTOCOL = """\
- Every contestant integrates the scene once from its own model file; what takes less than a second is measured
  {rounds} times, and the shortest time counts. Processor time is what the process used itself (all its threads);
  wall time includes whatever else the machine did. {threads}
- **Error**: the largest difference of the observables from {reference} at {samples} times; scaled: over their largest
  magnitude by unit. **Energy**: kinetic, of gravity and springs, less the work of motors, loads and dampers since the
  start; its largest change, computed from each contestant's joint coordinates and velocities by the same formulas.
- Tolerances rtol and atol of a step are alike, for angles, lengths and velocities. `screw` integrates the independent
  coordinates and finds the closed pose at every evaluation. Pinocchio and MuJoCo only give accelerations of their
  whole trees under constraints; they are driven by the same methods of scipy. The families with the name of an
  integrator are the engines' own steppers at fixed steps: MuJoCo's with its default softness (refined: solimp 0.9999
  and proximal refinements), Pinocchio's with a projection onto the closed loops after every step.
- A contestant is stopped after {each} s, the whole bench after {budget} s. Both are marked `cut short`.
- Published results were measured on other machines, some decades ago: their times are comparable to an order of
  magnitude at best. Their accuracy is what they state, or what the values that they print differ from the reference.
- All contestants here but the engines' inner loops run under Python: its overhead is in every time."""
