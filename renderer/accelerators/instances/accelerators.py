"""The accelerators of a scene, one for each kind of primitive that it has."""

from __future__ import annotations

from typing import Any, NamedTuple


class Accelerators(NamedTuple):
    """One for each kind of primitive, None where there is none; one for instances."""

    triangles: Any
    rectangles: Any
    disks: Any
    spheres: Any
    cylinders: Any
    implicits: Any
    sdf_cells: Any
    instances: Any = None  # accelerators.instances.Instances; the last to be traced
