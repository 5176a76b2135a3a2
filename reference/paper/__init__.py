"""The paper's own scheme, and its equations as printed."""

from screwgauge.reference.paper.scheme import Trajectory, chains, integrate

__all__ = ["Trajectory", "chains", "integrate"]
