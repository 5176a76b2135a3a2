"""What acts on a mechanism: loads, springs, motors, and the forces and energy of them all."""

from screwgauge.reference.applied import GRAVITY, Applied, JointSpring, Load, Motor, PointSpring, hold
from screwgauge.reference.courses import Course
