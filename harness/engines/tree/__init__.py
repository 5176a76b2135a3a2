"""Common code of open-tree engines: loop closure, forces, integration, coordinates of cut joints."""
