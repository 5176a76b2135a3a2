"""A description made from what was read of any URDF or MJCF."""
