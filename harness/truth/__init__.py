"""The engine `truth`, which computes motion and forces in ball arithmetic, with a rigorous radius for each number.

From `screwgauge.reference`, the engine takes only the tables of a description, their names and an unverified starting
guess of the positions; it uses none of the equations there. The engine needs python-flint (the extra ``truth``).
"""

#: Largest number of samples that the engine solves.
MOST = 201
_OPEN = dict.fromkeys(
    ("tree_force", "tree_force_soft"), "RNEA evaluates the open tree directly, which leaves nothing to certify"
)
#: Quantity that the engine does not compute -> reason.
LACKS = {
    **_OPEN,
    "mass_matrix": "it solves the Newton-Euler equations as one system",
    "axis_moment": "without springs, motors and resistance this is the actuator force, which it certifies",
}
