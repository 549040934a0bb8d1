"""KernelScene: all that the kernels may look at, as flat arrays in named records.

Whatever a scene lacks is None. A None is a type of its own, so the code that would read
it is never compiled: `if spheres is None: return ...` is decided at compile time for an
argument of a function.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# bits of `KernelScene.stages`: what a hit on a primitive needs next
EMIT = 1
DIFFUSE = 2
CONDUCTOR = 4
DIELECTRIC = 8
ANY = 16  # set for every primitive

# kinds of lights
POINT = 0
SPOT = 1
DIRECTIONAL = 2
CONSTANT = 3
AREA = 4


class Accelerators(NamedTuple):
    """One for each kind of primitive that the scene has, and one for all instances."""

    triangles: Any
    rectangles: Any
    disks: Any
    spheres: Any
    cylinders: Any
    instances: Any = None  # accelerators.instances.Instances


class Placements(NamedTuple):
    """Where the instances are: x_world = A x_object + a, by instance id."""

    # (12 n,) of each the rows of A, then a, side by side: a ray needs all of one instance
    to_world: NDArray[np.float32]
    to_object: NDArray[np.float32]  # (12 n,) the rows of the inverse of A, then a again
    group: NDArray[np.int32]  # (n,)
    number: NDArray[np.int32]  # (n,) in the file, with the shapes, the first is 1


class TriangleSurfaces(NamedTuple):
    """Triangles first .. end - 1 by primitive id; columns are relative to `first`."""

    first: int
    end: int
    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) unit edge1 x edge2
    normals: NDArray[np.float32] | None  # (9, n) unit, of the three vertices in turn
    uvs: NDArray[np.float32] | None  # (6, n) of the three vertices in turn
    tangents: NDArray[np.float32] | None = None  # (3, n) dp/du; None: nobody asks


class RectangleSurfaces(NamedTuple):
    """Parallelograms first .. end - 1 by primitive id."""

    first: int
    end: int
    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) unit edge1 x edge2


class DiskSurfaces(NamedTuple):
    """Disks first .. end - 1 by primitive id; corner is the centre."""

    first: int
    end: int
    corner: NDArray[np.float32]  # (3, n)
    edge1: NDArray[np.float32]  # (3, n)
    edge2: NDArray[np.float32]  # (3, n)
    normal: NDArray[np.float32]  # (3, n) unit edge1 x edge2


class SphereSurfaces(NamedTuple):
    """Spheres first .. end - 1 by primitive id."""

    first: int
    end: int
    center: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    frame: NDArray[np.float32]  # (9, n) unit local x, y, z axes in world space


class CylinderSurfaces(NamedTuple):
    """Cylinders first .. end - 1 by primitive id."""

    first: int
    end: int
    base: NDArray[np.float32]  # (3, n)
    radius: NDArray[np.float32]  # (n,)
    height: NDArray[np.float32]  # (n,)
    frame: NDArray[np.float32]  # (9, n) unit local x, y, z axes in world space


class Surfaces(NamedTuple):
    """What turns a hit into a surface point, for each kind of primitive."""

    triangles: Any
    rectangles: Any
    disks: Any
    spheres: Any
    cylinders: Any
    with_uv: int | None  # None: nobody looks at uv


class Shapes(NamedTuple):
    """Columns by shape id."""

    front: NDArray[np.int32]  # (n,) BSDF seen from the side of the normal, -1: black
    back: NDArray[np.int32]  # (n,) BSDF of the other side, -1: black
    light: NDArray[np.int32]  # (n,) area light on it, -1: none
    orientation: NDArray[np.float32]  # (n,) -1 where the outward normal is flipped
    number: NDArray[np.int32]  # (n,) in the file, the first is 1; 0 for shapes of groups


class Textures(NamedTuple):
    """All bitmaps in one long row of texels, and the checkerboards."""

    texels: NDArray[np.float32]  # (3, total), row after row from the top
    start: NDArray[np.int32]  # (n,) first texel, -1 for a checkerboard
    width: NDArray[np.int32]  # (n,)
    height: NDArray[np.int32]  # (n,)
    nearest: NDArray[np.int32]  # (n,) 1: no interpolation
    wrap: NDArray[np.int32]  # (n,) 0 repeat, 1 mirror, 2 clamp
    to_uv: NDArray[np.float32]  # (6, n) first two rows of the affine map
    colors: NDArray[np.float32]  # (6, n) of a checkerboard


class DiffuseTable(NamedTuple):
    """Columns by BSDF id (those of other kinds are unused)."""

    reflectance: NDArray[np.float32]  # (3, n)
    texture: NDArray[np.int32]  # (n,) texture id, -1: the constant reflectance
    textures: Textures | None


class ConductorTable(NamedTuple):
    """Columns by BSDF id."""

    eta: NDArray[np.float32]  # (3, n)
    k: NDArray[np.float32]  # (3, n)
    reflectance: NDArray[np.float32]  # (3, n)


class DielectricTable(NamedTuple):
    """Columns by BSDF id."""

    eta: NDArray[np.float32]  # (n,) inside over outside
    reflectance: NDArray[np.float32]  # (3, n)
    transmittance: NDArray[np.float32]  # (3, n)


class Bsdfs(NamedTuple):
    """All BSDFs of the scene, by kind."""

    kind: NDArray[np.int32]  # (n,) DIFFUSE, CONDUCTOR or DIELECTRIC
    diffuse: Any
    conductor: Any
    dielectric: Any


class PointLights(NamedTuple):
    """Columns by light id (those of other kinds are unused)."""

    position: NDArray[np.float32]  # (3, n)
    intensity: NDArray[np.float32]  # (3, n)


class SpotLights(NamedTuple):
    """Columns by light id."""

    position: NDArray[np.float32]  # (3, n)
    axis: NDArray[np.float32]  # (3, n) unit
    intensity: NDArray[np.float32]  # (3, n)
    cos_cutoff: NDArray[np.float32]  # (n,)
    cos_beam: NDArray[np.float32]  # (n,)
    cutoff: NDArray[np.float32]  # (n,) [rad]
    inverse_transition: NDArray[np.float32]  # (n,) 1 / (cutoff - beam width) [1/rad]


class DirectionalLights(NamedTuple):
    """Columns by light id."""

    to_light: NDArray[np.float32]  # (3, n) unit
    irradiance: NDArray[np.float32]  # (3, n)
    distance: float  # beyond the whole scene


class ConstantLights(NamedTuple):
    """The environment; at most one."""

    radiance: NDArray[np.float32]  # (3, n)
    distance: float  # beyond the whole scene


class TriangleShares(NamedTuple):
    """Cumulated areas that choose a triangle of a mesh light as Mitsuba does."""

    first: NDArray[np.int32]  # (n,) of each light, into the columns below
    count: NDArray[np.int32]  # (n,)
    area: NDArray[np.float32]  # (n,) of the whole mesh
    cumulated: NDArray[np.float32]  # (total,) area of a triangle and all before it
    below: NDArray[np.float32]  # (total,) share of the area before a triangle
    lost: NDArray[np.float32]  # (total,) what the rounding of `below` has lost
    share: NDArray[np.float32]  # (total,) of the triangle itself
    prim: NDArray[np.int32]  # (total,) primitive id


class TriangleLights(NamedTuple):
    """Alias tables [Walker1977] that choose a triangle of a mesh light by its area."""

    first: NDArray[np.int32]  # (n,) of each light, into the columns below
    count: NDArray[np.int32]  # (n,)
    keep: NDArray[np.float32]  # (total,) probability to stay with the column drawn
    alias: NDArray[np.int32]  # (total,) where to go otherwise
    prim: NDArray[np.int32]  # (total,) primitive id


class AreaLights(NamedTuple):
    """Columns by light id; the shape's arrays are those of `Surfaces`."""

    radiance: NDArray[np.float32]  # (3, n)
    inverse_area: NDArray[np.float32]  # (n,)
    prim: NDArray[np.int32]  # (n,) primitive id of an analytic shape
    orientation: NDArray[np.float32]  # (n,)
    replay: int | None  # 1: densities as Mitsuba computes them
    triangles: TriangleLights | TriangleShares | None
    rectangles: int | None  # None: no light of this shape
    disks: int | None
    spheres: int | None
    cylinders: int | None


class Lights(NamedTuple):
    """All lights, by kind."""

    count: int
    kind: NDArray[np.int32]  # (n,)
    points: Any
    spots: Any
    directionals: Any
    constants: Any
    areas: Any


class Camera(NamedTuple):
    """A pinhole: rays from `origin` along corner + x right + y down, in pixels."""

    origin: NDArray[np.float32]  # (3, 1)
    corner: NDArray[np.float32]  # (3, 1) towards pixel position (0, 0)
    right: NDArray[np.float32]  # (3, 1) one pixel further in x
    down: NDArray[np.float32]  # (3, 1) one pixel further in y
    forward: NDArray[np.float32]  # (3, 1) unit
    near: float
    far: float


class Settings(NamedTuple):
    """What the chosen method does; None leaves a step out of the compiled code."""

    max_depth: int  # path segments; a large number for "no limit"
    roulette_depth: int | None  # None: no Russian roulette
    weigh: int | None  # None: no multiple importance sampling
    every_light: int | None  # None: one light of all, chosen at random
    follow: int | None  # None: rays end at diffuse surfaces
    hide_emitters: int  # 1: the camera looks through them
    cutoff: float  # Whitted: weight below which a ray is dropped
    rounding_offset: float  # rays start so many rounding errors off their surface ...
    fixed_offset: float  # ... plus this times (1 + the largest coordinate)
    replay: int | None  # 1: choose lights, points and frames as Mitsuba does; None: our way


class KernelScene(NamedTuple):
    """The whole scene."""

    accelerators: Accelerators
    # without the area lights that the camera hides; None: the same as `accelerators`
    camera_accelerators: Accelerators | None
    surfaces: Surfaces
    stages: NDArray[np.int32]  # (primitives,) bits EMIT, DIFFUSE, ...
    shape: NDArray[np.int32]  # (primitives,) shape id
    face: NDArray[np.int32]  # (primitives,) index in the mesh's file, 0 for others
    shapes: Shapes
    bsdfs: Bsdfs
    lights: Lights | None
    camera: Camera
    sampler: Any
    settings: Settings
    replayed: Any = None  # replay.surfaces.ReplaySurfaces; None: this is no replay
