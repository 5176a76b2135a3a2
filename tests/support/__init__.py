"""What tests need of the package, by purpose.

Where a name is defined inside is known here: where modules merge or move, these imports change and no test does. What
one file alone takes apart, it may import itself. Nothing here is imported earlier than its users need it: mujoco and
pinocchio by `trees`, flint by `truth`, what diagnoses by `diagnosis`, `causes`, `mechanics` and `gate`.
"""
