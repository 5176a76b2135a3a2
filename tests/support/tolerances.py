"""Named bounds of the tests, with the reason beside each.

Bounds called relative are shares of the largest value compared; the others are in rad, m, N, N m, and per s.
"""

# --- rounding: a double is off by 1.1e-16 of itself -------------------------------------------------------------------

#: Placements, rotations and axes of numbers about 1: a handful of operations, each rounded.
PLACED = 1e-15
#: A rotation taken apart into a quaternion or three angles and put together again: twelve products, each rounded.
#: Roll, pitch and yaw keep to 1e-15, quaternions to 1.4e-15, of one machine or another.
TAKEN_APART = 1.5e-15
#: Numbers about 1 that a closed form, or exact decimals of 20 digits, give too: one rounding of numbers below 1/2.
TWENTY_DIGITS = 1e-16
#: Lengths and moments of inertia from closed forms, relative: a few dozen operations.
FORMULA = 1e-14
#: Screws, chains and loops with numbers about 1: a few hundred operations.
ROUNDING = 1e-13
#: Loops that Newton's method closes, with numbers about 1: its last step leaves rounding alone.
CLOSED = 1e-14
#: Two routes through the same linear equations of conditions below a hundred, relative.
LINEAR = 1e-12
#: Motion that follows from forces for some seconds, against an integration by another method at its tightest.
IDLE_MOTION = 2e-12
#: Accelerations from the forces that made them, relative: two dense solutions of conditions of a few hundred.
#: 1e-13 is seen.
ROUND_TRIP = 1e-11
#: The same where redundant constraints are solved with, too: the smallest solution costs two digits more.
DENSE = 1e-10
#: Angles of a rotation: three rotations multiplied and taken apart again, away from a gimbal lock. It divides rounding
#: by the distance to the lock, a hundredth of a radian in these tests (`BY_LOCK`), and by its square for rates.
READ = 1e-12
BY_LOCK = 100.0

# --- differences: step h, error h^2 times third derivatives, and rounding over h --------------------------------------

#: First derivatives of positions and rates of slow motions, h = 1e-5.
DIFFERENCE = 8e-9
#: First derivatives of energies of some 10 J, h = 1e-5 or 1e-6: rounding over h.
SLOPE_OF_ENERGY = 1e-6
#: Second derivatives on a path of some 7 rad/s, h = 1e-5: third derivatives of up to 300 rad/s^3 and rounding over h.
FAST_DIFFERENCE = 1e-5

# --- what was printed or published ------------------------------------------------------------------------------------

#: Half a unit of the fourth decimal, and of the first.
PRINTED, PRINTED_COARSELY = 5.01e-5, 0.0501
#: Digits of published eigenvalues: relative, and absolute.
PUBLISHED = 1e-3, 5e-3

# --- engines against each other and the truth, scaled -----------------------------------------------------------------

#: Default scenes: conditions up to 60, and 1e-13 from rounding in each engine.
AGREE = 1e-11
#: The open tree needs no loop: recursive Newton-Euler against `mj_inverse`.
RECURSIVE = 3e-13
#: Of reactions and forces of 1 kN, in N.
OF_A_KILONEWTON = 1e-8
#: Scaled radii of the truth: 57 digits, of which a dozen are lost on the way to the reactions.
RADIUS = 1e-46
#: What is promised of the solver against the truth.
SOLVER = 1e-12
#: Doubles nearest to the truth satisfy the laws of mechanics to their rounding.
NEAREST = 1e-13
#: Decades by which an error estimate may exceed the error in the mean: 2.9 to 3.02 on different machines.
TIGHT = 3.1
#: Share of the largest force, or of a mass, by which a number has to be off for the comparison and the judge to notice:
#: a hundred times the tolerance.
NOTICED = 1e-9
#: An error below this is equality.
EQUAL = 1e-17

# --- integrated motions -----------------------------------------------------------------------------------------------

#: Largest error of the observables of an established problem [m, rad]: ten times and more what is seen, which is what
#: the tolerances of the steps leave. Two four-bars pass singular poses, and the error grows tenfold at each.
FOLLOWED = {
    "a01-pendulum": 1e-9,
    "a02-fourbar-2": 1e-6,
    "a02-fourbar-40": 1e-6,
    "a03-andrews-ivp": 1e-10,
    "a04-bricard-thin": 1e-10,
    "a04-bricard-box": 1e-10,
    "a05-governor": 1e-7,
}
#: The same of the solver over all of their time, at the tolerance of the test; the four-bars pass ten singular poses,
#: where forty of them amplify the rounding of 120 coordinates: 4.1e-6 or 5.4e-6 are left, as equations are written.
FOLLOWED_TO_THE_END = {
    "a02-fourbar-2": 1.5e-6,
    "a02-fourbar-40": 1e-5,
    "a03-andrews-ivp": 2e-9,
    "a03-andrews-iftomm": 2e-9,
    "a05-governor": 1e-7,
}
#: What steps of rtol 1e-10 to 1e-11 leave after a second or less, with its growth.
STEPPED = 1e-8
#: What `a01-pendulum` asks for [m]: nine digits.
NINE_DIGITS = 1e-9
#: Energy for an error of the position under forces of up to 100 N [J per m].
ENERGY_PER_ERROR = 100.0
#: A fall through gimbal locks: what the tolerances of the steps leave, ten times what is seen: positions, rates,
#: accelerations of up to 250 per s^2.
FALLEN = {"q": 1e-8, "v": 1e-7, "a": 3e-6}
#: Of the order of a stepper, from two steps: the next term of its error is still seen.
ORDER = 0.3
#: Loops of a refined step: what is left is the drift of one step of 1 ms [m].
DRIFT = 1e-8
#: First order in a step of 0.1 ms against fourth order [rad]; first order in a step of 1 ms, work of up to 1 J [J].
FIRST_ORDER, FIRST_ORDER_WORK = 5e-4, 5e-2
