"""The paper's own scheme, and its equations as printed."""
