"""The paper's own scheme, and its equations as printed."""

from screwgauge.reference.paper.scheme import integrate

__all__ = ["integrate"]
