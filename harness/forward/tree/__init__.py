"""Pinocchio and MuJoCo integrated in all coordinates of their open trees."""
