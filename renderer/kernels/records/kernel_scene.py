"""KernelScene: all that the kernels may look at, as flat arrays in named records.

It is of one type for all scenes, so that what is common to them is compiled once. What a
scene is made of (kinds of shapes, BSDFs, lights, ...) are rows of tables: each row has the
address of the kind's own record, and those of its kernels (`kernels.jit.methods`). What a
scene lacks has no row: it is neither compiled nor run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import table_columns
from renderer.kernels.records.media import Media

# bits of `Primitives.stages`: what a hit on a primitive needs next
ANY = 1  # set for every primitive
EMIT = 2
FIRST_BSDF = 4  # of the first kind of BSDF that the scene has; the next kinds follow
MOST_BSDF_KINDS = 29  # whose bits fit into 32

HALVES = -2  # in place of a face's number, see `Primitives`

# Columns of the tables of methods. In each the first is the address of the kind's record.
RECORD = 0
# groups of primitives to intersect
CLOSEST_COHERENT, CLOSEST = 1, 2
# the same for shadow rays
ANY_COHERENT, ANY_SINGLE = 1, 2
# kinds of shapes
LOCATE = 1
# kinds of BSDFs
REFLECT_LIGHT, SCATTER, SPLIT = 1, 2, 3
SHOW_ALBEDO, SHOW_SEEN_ALBEDO, SHOW_NORMAL = 4, 5, 6
LET_THROUGH = 7
# kinds of textures: the methods of each
LOOK_UP_COLOR, LOOK_UP_SCALAR, LOOK_UP_GRADIENT = 1, 2, 3
# kinds of shapes, for bumps
DERIVE = 1
# kinds of lights
SAMPLE_LIGHT, EMISSION, ENVIRONMENT = 1, 2, 3
LAMP_DENSITY, SKY_DENSITY = 4, 5
# the choice of one of several lights
CHOOSE_BY_IMPORTANCE, WEIGH_FOUND = 1, 2
# the sensor
FILL_RAYS = 1
# the sampler
DRAW_FILM, BEGIN_BOUNCE, DRAW, CHOOSE_LIGHT, DRAW_APERTURE = 1, 2, 3, 4, 5
# what may be done after a stage, a row each; after surface points, any number of rows
AFTER_CAMERA_RAYS, AFTER_SCATTERING, AFTER_SURFACE_POINTS = 0, 1, 2

Methods = NDArray[np.int64]  # (kinds, columns) addresses; 0 where there is no such method


class Placements(NamedTuple):
    """Where the instances are: x_world = A x_object + a, by instance id."""

    # (12 n,) of each the rows of A, then a, side by side: a ray needs all of one instance
    to_world: NDArray[np.float32]
    to_object: NDArray[np.float32]  # (12 n,) the rows of the inverse of A, then a again
    group: NDArray[np.int32]  # (n,)
    number: NDArray[np.int32]  # (n,) in the file, with the shapes, the first is 1


class Shapes(NamedTuple):
    """Columns by shape id."""

    front: NDArray[np.int32]  # (n,) BSDF seen from the side of the normal, -1: black
    back: NDArray[np.int32]  # (n,) BSDF of the other side, -1: black
    light: NDArray[np.int32]  # (n,) area light on it, -1: none
    orientation: NDArray[np.float32]  # (n,) -1 where the outward normal is flipped
    number: NDArray[np.int32]  # (n,) in the file, the first is 1; 0 for shapes of groups
    pane: NDArray[np.int32]  # (n,) 1 where it is one, see `scene.panes`


class Primitives(NamedTuple):
    """Columns by primitive id."""

    stages: NDArray[np.int32]  # (n,) bits ANY, EMIT, ...
    shape: NDArray[np.int32]  # (n,) shape id
    # (n,) index within its shape (of a mesh: in the file); HALVES for a rectangle, whose
    # two halves are faces 0 and 1
    face: NDArray[np.int32]


@table_columns("values")
class Bsdfs(NamedTuple):
    """All BSDFs of the scene: the kinds, and columns by BSDF id."""

    methods: Methods  # of the kinds; those with smooth lobes come first
    smooth: int  # how many these are
    kind: NDArray[np.int32]  # (n,) row of `methods`, -1 in a scene without any
    values: NDArray[np.float32]  # (rows, n) parameters, in the order of the kind's record
    rows: NDArray[np.int32]  # (kinds,) how many rows a kind has
    # (m, 4) what to look up: kind of BSDF, kind of texture, first row, LOOK_UP_...
    look_ups: NDArray[np.int64]
    texture: NDArray[np.int32]  # (rows, n) texture id, -1: the constant of `values`
    texture_kind: NDArray[np.int32]  # (textures,) row of `texture_methods`, -1: nested
    texture_methods: Methods
    derived: NDArray[np.int64]  # (m, 2) kind of BSDF, first of six rows: dp/du, dp/dv
    derivatives: Methods  # of the kinds of shapes, where a BSDF needs them


class Lights(NamedTuple):
    """All lights."""

    count: int
    kind: NDArray[np.int32]  # (n,) row of `methods`
    sampled: NDArray[np.int32]  # those that are sampled; the others are only found
    methods: Methods
    # One row where one of several is chosen at a point by what it can give there. None: all
    # are sampled, or one that the sampler chooses, each as often as any other.
    choice: Methods


class Settings(NamedTuple):
    """What the chosen method does; 0 is no."""

    max_depth: int  # path segments; a large number for "no limit"
    roulette_depth: int  # where Russian roulette begins; a large number for "never"
    dim_depth: int  # where it begins for dim paths
    survival_scale: float  # by which a path's throughput gives how likely it survives
    weigh: int  # multiple importance sampling
    every_light: int  # all lights at each point, instead of one chosen at random
    hide_emitters: int  # the camera looks through them
    transparent: int  # see `integrators.stages.straight_through`
    with_uv: int  # whether a texture or an AOV uses uv
    with_tangents: int  # whether a BSDF or an AOV uses dp/du
    light_samples: int  # of `direct`, at each point
    bsdf_samples: int  # of `direct`, at each point
    light_share: float  # light samples for each BSDF sample, which weighs their densities
    cutoff: float  # weight below which a ray is dropped
    rounding_offset: float  # rays start so many rounding errors off their surface ...
    fixed_offset: float  # ... plus this times (1 + the largest coordinate)
    before_light: float  # shadow rays end at this part of the way to the light


class KernelScene(NamedTuple):
    """The whole scene."""

    groups: Methods  # primitives to intersect
    camera_groups: Methods  # the same, without the area lights that the camera hides
    shadow_groups: Methods  # without what is never between a surface and a light
    surfaces: Methods  # kinds of shapes: from hits to surface points
    placements: Placements
    primitives: Primitives
    shapes: Shapes
    bsdfs: Bsdfs
    lights: Lights
    sensor: Methods  # one row
    sampler: Methods  # one row
    hooks: Methods  # AFTER_CAMERA_RAYS, ...
    settings: Settings
    media: Media
    # where light samples go through panes: these alone, and the area lights alone
    pane_groups: Methods
    lamp_groups: Methods
    # (5, n) small lamps in fog, if light is looked for near them (`scene.fog_lamps`): the
    # centre, the squared radius, and the strength in parts of the largest
    fog_lamps: NDArray[np.float32]
