"""KernelScene: everything that kernels read of a scene, as flat arrays in named records.

It has the same type for all scenes, so the stages are compiled once. The kinds of shapes,
BSDFs, lights and so on of a scene are rows of tables. A row has the address of the kind's
own record, and the addresses of its kernels (`kernels.jit.interfaces`). A kind that a scene
lacks has no row: it is neither compiled nor run.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.kernels.jit import table_columns
from renderer.kernels.records.media import Media

# bits of `Primitives.stages`: the next stages of a hit on a primitive
ANY = 1  # set for every primitive
EMIT = 2
FIRST_BSDF = 4  # bit of the scene's first kind of BSDF; the next kinds follow
MOST_BSDF_KINDS = 29  # so that their bits fit into 32

HALVES = -2  # instead of a face index, see `Primitives`

# Columns of the tables of methods. Column 0 is always the address of the kind's record.
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
# kinds of textures
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
# hooks after a stage, one row each; after surface points, any number of rows
AFTER_CAMERA_RAYS, AFTER_SCATTERING, AFTER_SURFACE_POINTS = 0, 1, 2

Methods = NDArray[np.int64]  # (kinds, columns) addresses; 0 if the kind has no such method


class Placements(NamedTuple):
    """The transforms of the instances, x_world = A x_object + a, by instance id."""

    # (12 n,) per instance the rows of A, then a, contiguous: a ray needs all of them
    to_world: NDArray[np.float32]
    to_object: NDArray[np.float32]  # (12 n,) the rows of the inverse of A, then a again
    group: NDArray[np.int32]  # (n,) group id
    number: NDArray[np.int32]  # (n,) index in the file, counted from 1 together with shapes


class Shapes(NamedTuple):
    """Columns by shape id."""

    front: NDArray[np.int32]  # (n,) BSDF id on the side of the normal, -1: black
    back: NDArray[np.int32]  # (n,) BSDF id on the other side, -1: black
    light: NDArray[np.int32]  # (n,) area light id, -1: none
    orientation: NDArray[np.float32]  # (n,) -1 if the outward normal is flipped
    number: NDArray[np.int32]  # (n,) index in the file, from 1; 0 for shapes of groups
    pane: NDArray[np.int32]  # (n,) 1 if it is a pane, see `scene.panes`


class Primitives(NamedTuple):
    """Columns by primitive id."""

    stages: NDArray[np.int32]  # (n,) bits ANY, EMIT, ...
    shape: NDArray[np.int32]  # (n,) shape id
    # (n,) index within its shape (of a mesh: in the file); HALVES for a rectangle, whose
    # two halves are faces 0 and 1
    face: NDArray[np.int32]


@table_columns("values")
class Bsdfs(NamedTuple):
    """All BSDFs of the scene: methods by kind, columns by BSDF id."""

    methods: Methods  # rows by kind; kinds with smooth lobes come first
    smooth: int  # number of kinds with smooth lobes
    kind: NDArray[np.int32]  # (n,) row of `methods`, -1 in a scene without BSDFs
    values: NDArray[np.float32]  # (rows, n) parameters, in the order of the kind's record
    rows: NDArray[np.int32]  # (kinds,) number of parameter rows of a kind
    # (m, 4) texture look-ups: kind of BSDF, kind of texture, first row, LOOK_UP_...
    look_ups: NDArray[np.int64]
    texture: NDArray[np.int32]  # (rows, n) texture id, -1: the constant of `values`
    texture_kind: NDArray[np.int32]  # (textures,) row of `texture_methods`, -1: nested
    texture_methods: Methods
    derived: NDArray[np.int64]  # (m, 2) kind of BSDF, first of six rows: dp/du, dp/dv
    derivatives: Methods  # rows by kind of shape, if a BSDF needs derivatives


class Lights(NamedTuple):
    """All lights."""

    count: int
    kind: NDArray[np.int32]  # (n,) row of `methods`
    sampled: NDArray[np.int32]  # ids for light samples; others are found by hits only
    methods: Methods
    # One row if a light is chosen by its estimated contribution at the point. Without rows,
    # all lights are sampled, or the sampler chooses one with uniform probability.
    choice: Methods


class Settings(NamedTuple):
    """Parameters of the chosen method; as flags 0 is no."""

    max_depth: int  # path segments; a large number for "no limit"
    roulette_depth: int  # first depth of Russian roulette; a large number for "never"
    dim_depth: int  # the same for dim paths (`integrators/path.py`)
    survival_scale: float  # survival probability = this factor times the throughput
    weigh: int  # flag: multiple importance sampling
    every_light: int  # flag: sample all lights at each point, instead of a random one
    hide_emitters: int  # flag: emitters are invisible to the camera
    transparent: int  # flag: see `integrators.stages.straight_through`
    with_uv: int  # flag: a texture or an AOV uses uv
    with_tangents: int  # flag: a BSDF or an AOV uses dp/du
    light_samples: int  # per point, for `direct`
    bsdf_samples: int  # per point, for `direct`
    light_share: float  # light samples per BSDF sample; scales the light pdf in MIS weights
    cutoff: float  # throughput below which a ray is dropped
    rounding_offset: float  # ray offset from the surface: this many rounding errors ...
    fixed_offset: float  # ... plus this times (1 + the largest coordinate)
    before_light: float  # t_max of shadow rays, as a fraction of the distance to the light


class KernelScene(NamedTuple):
    """The whole scene."""

    groups: Methods  # primitives to intersect
    camera_groups: Methods  # the same, without area lights that are hidden from the camera
    shadow_groups: Methods  # the same, without primitives that never occlude a light
    surfaces: Methods  # kinds of shapes: hits to surface points
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
    # for light samples through panes: the panes only, and the area lights only
    pane_groups: Methods
    lamp_groups: Methods
    # (5, n) small lamps in fog, for equiangular sampling (`scene.fog_lamps`): centre,
    # squared radius, and strength relative to the strongest
    fog_lamps: NDArray[np.float32]
