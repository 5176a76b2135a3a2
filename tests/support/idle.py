"""A machine with a freedom that nothing drives: a pole on a driven cart."""

CART = """
name = "cart"
[independent]
cart = "rail"
angle = "hinge"
[bodies.cart]
mass = 2
inertia = { xx = 1e-2, yy = 2e-2, zz = 2e-2 }
[bodies.pole]
mass = 1
com = [0, 0, -0.7]
inertia = { xx = 1e-2, yy = 2e-2, zz = 1.5e-2 }
[joints.rail]
kind = "P"
parent = "ground"
child = "cart"
axes = [[1, 0, 0]]
actuated = true
[joints.hinge]
kind = "R"
parent = "cart"
child = "pole"
axes = [[0, -1, 0]]
home = [0.5]
"""
