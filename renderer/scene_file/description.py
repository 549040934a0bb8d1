"""SceneDescription: the contents of a scene file, checked and with all default values.

The reader (this package) creates it; `renderer.scene.scene` turns it into the arrays of the
kernels. All records are plain data. Transforms map local to world coordinates and act on
column vectors. Colours are linear sRGB. Angles are in degrees, as in the file.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from renderer.mitsuba_version import NEWEST
from renderer.scene_file.images.image import Image
from renderer.scene_file.media_description import GridVolume, Medium

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Location:
    """Place of an element, for error messages; `line` is 0 for a dictionary."""

    file: str
    line: int

    def __str__(self) -> str:
        """Return `file:line`, a form that editors can open."""
        return f"{self.file}:{self.line}" if self.line else self.file


NOWHERE = Location("<memory>", 0)


# ---------------------------------------------------------------- textures


@dataclass(frozen=True)
class ConstantTexture:
    """A constant colour."""

    rgb: Rgb


WHITE = ConstantTexture((1.0, 1.0, 1.0))


@dataclass(frozen=True, eq=False)
class BitmapTexture:
    """An image over (u, v); row 0 of `texels`, the last of the file, is at v near 1."""

    texels: NDArray[Any]  # (H, W, 1 or 3), finite, uint8, float16 or float32
    filter_type: str = "bilinear"  # or "nearest"
    wrap_mode: str = "repeat"  # or "mirror", "clamp"
    to_uv: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))  # on (u, v, 1)
    srgb: bool = False  # whether bytes are sRGB encoded; other types are linear

    @cached_property
    def pixels(self) -> NDArray[np.float32]:
        """Linear RGB, (H, W, 3)."""
        return Image(self.texels, self.srgb).linear


@dataclass(frozen=True, eq=False)
class CheckerboardTexture:
    """Two colours in a 2 x 2 pattern per unit square of the transformed (u, v)."""

    color0: Texture = ConstantTexture((0.4, 0.4, 0.4))
    color1: Texture = ConstantTexture((0.2, 0.2, 0.2))
    to_uv: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True, eq=False)
class MeshAttributeTexture:
    """An attribute of a mesh per vertex ("vertex_...") or per face ("face_...")."""

    name: str
    scale: float = 1.0
    location: Location = NOWHERE


@dataclass(frozen=True, eq=False)
class VolumeTexture:
    """A volume in world space, evaluated at the points of a surface."""

    volume: GridVolume
    location: Location = NOWHERE


Texture = (
    ConstantTexture
    | BitmapTexture
    | CheckerboardTexture
    | MeshAttributeTexture
    | VolumeTexture
)
Radiance = Rgb | BitmapTexture | CheckerboardTexture  # of an area light


# ------------------------------------------------------------------- BSDFs


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambertian: reflectance / pi on the front side, black on the back."""

    plugin: ClassVar[str] = "diffuse"
    reflectance: Texture = ConstantTexture((0.5, 0.5, 0.5))


@dataclass(frozen=True, eq=False)
class Dielectric:
    """Smooth dielectric; `eta` is the interior over the exterior index of refraction."""

    plugin: ClassVar[str] = "dielectric"
    eta: float = 1.5046 / 1.000277
    specular_reflectance: Texture = WHITE
    specular_transmittance: Texture = WHITE


@dataclass(frozen=True, eq=False)
class Conductor:
    """Smooth conductor, one-sided; `material` "none" is eta 0, k 1: a perfect mirror."""

    plugin: ClassVar[str] = "conductor"
    eta: Texture
    k: Texture
    specular_reflectance: Texture = WHITE


@dataclass(frozen=True, eq=False)
class OtherBsdf:
    """A BSDF of a registered kind; its parameters are attributes, as for other BSDFs."""

    plugin: str
    values: Mapping[str, Texture | float]

    def __getattr__(self, name: str) -> Texture | float:
        """Return a parameter."""
        try:  # not `self.values`: copying and unpickling read attributes before it exists
            return vars(self)["values"][name]
        except KeyError:
            raise AttributeError(name) from None


@dataclass(frozen=True, eq=False)
class ThinDielectric:
    """A pane of glass with both its interfaces; `eta` as for `Dielectric`."""

    plugin: ClassVar[str] = "thindielectric"
    eta: float = 1.5046 / 1.000277
    specular_reflectance: Rgb = (1.0, 1.0, 1.0)
    specular_transmittance: Rgb = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Null:
    """Null BSDF: light passes straight through."""

    plugin: ClassVar[str] = "null"


@dataclass(frozen=True, eq=False)
class TwoSided:
    """A BSDF without transmission for each side; given once, for both sides."""

    plugin: ClassVar[str] = "twosided"
    front: Bsdf
    back: Bsdf


@dataclass(frozen=True, eq=False)
class Mask:
    """Opacity mask: the nested BSDF times `opacity`, else straight transmission."""

    plugin: ClassVar[str] = "mask"
    opacity: Texture
    nested: Bsdf


@dataclass(frozen=True, eq=False)
class Blend:
    """Blend of two BSDFs; `weight` is that of the second."""

    plugin: ClassVar[str] = "blendbsdf"
    weight: Texture
    first: Bsdf
    second: Bsdf


@dataclass(frozen=True, eq=False)
class NormalMap:
    """Normal map: local normals (1 + n) / 2 for the nested BSDF."""

    plugin: ClassVar[str] = "normalmap"
    normalmap: Texture
    flip_invalid_normals: bool
    use_shadowing_function: bool
    nested: Bsdf


@dataclass(frozen=True, eq=False)
class BumpMap:
    """Bump map: the nested BSDF on a surface displaced by `scale` times `height`."""

    plugin: ClassVar[str] = "bumpmap"
    height: Texture
    scale: float
    flip_invalid_normals: bool
    use_shadowing_function: bool
    nested: Bsdf


Bsdf = (
    Diffuse
    | Dielectric
    | ThinDielectric
    | Conductor
    | Null
    | OtherBsdf
    | TwoSided
    | Mask
    | Blend
    | NormalMap
    | BumpMap
)


# ------------------------------------------------------------------ shapes


@dataclass(frozen=True, eq=False)
class Program:
    """A function of x, y, z, as a program for a stack machine."""

    operations: NDArray[np.int32]  # (n,) see `objects.expressions`
    operands: NDArray[np.float64]  # (n,) value of a constant, exponent of a power
    text: str  # its source


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """Fields of all shapes."""

    bsdf: Bsdf
    radiance: Radiance | None = None  # of an area light, on the side of the normal
    interior: Medium | None = None  # behind the surface; both None: not a boundary
    exterior: Medium | None = None  # on the side of the normal
    id: str = ""
    location: Location = NOWHERE


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh(Shape):
    """Triangles in world space (obj, ply, cube); `flip_normals` is already applied."""

    vertices: NDArray[np.float32]  # (V, 3) finite
    faces: NDArray[np.int32]  # (F, 3) in [0, V), no degenerate ones
    # (V, 3) unit, except in `simplifications.instances`; None: face normals
    normals: NDArray[np.float32] | None = None
    uvs: NDArray[np.float32] | None = None  # (V, 2)
    face_ids: NDArray[np.int32] | None = None  # (F,) index in the file; None: 0..F-1
    flip_normals: bool = False  # the geometric normal is -(e1 x e2)
    # "vertex_..." (V, size) and "face_..." (F, size), finite
    attributes: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class Rectangle(Shape):
    """[-1, 1]^2 in the local plane z = 0, normal +z; uv = (xy + 1) / 2."""

    to_world: NDArray[np.float64]  # (4, 4)
    flip_normals: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Disk(Shape):
    """The local unit disk in z = 0, normal +z; uv = (radius, angle / 2 pi)."""

    to_world: NDArray[np.float64]  # (4, 4)
    flip_normals: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Sphere(Shape):
    """The local unit sphere; `to_world` holds center, radius and the file's to_world."""

    to_world: NDArray[np.float64]  # (4, 4), rotation times uniform scale, translation
    flip_normals: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Cylinder(Shape):
    """The local radius-1 tube around z from 0 to 1, without caps."""

    to_world: NDArray[np.float64]  # (4, 4)
    flip_normals: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Implicit(Shape):
    """Zeros of a function of local x, y, z in a box; its gradient points outwards."""

    to_world: NDArray[np.float64]  # (4, 4)
    bounds: NDArray[np.float64]  # (2, 3) lower and upper corner of the box, local
    program: Program
    flip_normals: bool = False


@dataclass(frozen=True, eq=False, kw_only=True)
class SdfGrid(Shape):
    """Signed distances on a grid in [0, 1]^3; the surface is where they are 0."""

    to_world: NDArray[np.float64]  # (4, 4)
    distances: NDArray[np.float32]  # (z, y, x), at least 2 along each axis, finite
    smooth: bool = True  # shading normals are continuous


@dataclass(frozen=True, eq=False, kw_only=True)
class Curves(Shape):
    """Curves in world space: a ball of varying radius, swept along control points."""

    points: NDArray[np.float32]  # (n, 4) control points x, y, z, radius; radii are >= 0
    starts: NDArray[np.int64]  # (curves,) ascending: first control point of each curve


@dataclass(frozen=True, eq=False, kw_only=True)
class LinearCurve(Curves):
    """Straight segments between the control points, with a ball at each point."""


@dataclass(frozen=True, eq=False, kw_only=True)
class BsplineCurve(Curves):
    """Uniform cubic B-splines of points and radii, with open ends."""


# ---------------------------------------------------- groups and instances


@dataclass(frozen=True, eq=False)
class Group:
    """Shapes that only instances show; none of them is an emitter."""

    shapes: tuple[Shape, ...]  # at least one
    id: str = ""
    location: Location = NOWHERE


@dataclass(frozen=True, eq=False)
class Instance:
    """A transformed copy of a group."""

    group: int  # index in `SceneDescription.groups`
    to_world: NDArray[np.float64]  # (4, 4) of the whole group
    place: int  # index among the scene's shapes and instances, in the order of the file
    id: str = ""
    location: Location = NOWHERE


# ---------------------------------------------------------------- emitters


@dataclass(frozen=True)
class PointLight:
    """A point light with radiant intensity `intensity` [W/sr] in all directions."""

    position: tuple[float, float, float]  # world
    intensity: Rgb


@dataclass(frozen=True, eq=False)
class SpotLight:
    """A spot light along local +z; full to `beam_width`, linear in angle to the cutoff."""

    to_world: NDArray[np.float64]  # (4, 4) without scale
    intensity: Rgb
    cutoff_angle: float = 20.0  # [deg], half angle
    beam_width: float = 15.0  # [deg], half angle; Mitsuba's default is 3/4 of the cutoff
    texture: Texture | None = None  # factor of the intensity, over the square of the cone
    scale: float = 1.0  # of the file's transform; it only affects rounding


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along `direction` (unit, world)."""

    direction: tuple[float, float, float]
    irradiance: Rgb  # on a plane perpendicular to it


@dataclass(frozen=True)
class ConstantLight:
    """A constant environment: equal radiance from all directions."""

    radiance: Rgb


@dataclass(frozen=True, eq=False)
class Projector:
    """A slide at local z = 1, projected along local +z; local +x is its left."""

    plugin: ClassVar[str] = "projector"
    to_world: NDArray[np.float64]  # (4, 4), without scale
    irradiance: Texture  # at the slide
    scale: float
    fov_x: float  # [deg] across the slide's width
    aspect: float  # width over height


@dataclass(frozen=True, eq=False)
class EnvironmentMap:
    """An environment map: row 0 is local +y, column (0.5 + i) W is local +z."""

    plugin: ClassVar[str] = "envmap"
    pixels: NDArray[np.float32]  # (H, W, 3) linear, from the top; at least 3 x 2
    scale: float
    to_world: NDArray[np.float64]  # (4, 4), a rotation or mirroring
    mis_compensation: bool = False  # light samples only for radiance above the mean


@dataclass(frozen=True, eq=False)
class SunSky:
    """Sun and sky by the model of Hosek and Wilkie; local +z is up."""

    plugin: ClassVar[str] = "sunsky"
    sun_direction: tuple[float, float, float]  # unit, world, to the sun
    turbidity: float  # of the air, 1 to 10
    albedo: Rgb  # of the ground
    sun_scale: float
    sky_scale: float
    sun_aperture: float  # [deg] the whole angle
    complex_sun: bool  # with limb darkening
    to_world: NDArray[np.float64]  # (4, 4), a rotation or mirroring


@dataclass(frozen=True, eq=False)
class AreaLight:
    """An area emitter; the shape stores its radiance."""

    radiance: Radiance


Emitter = (
    PointLight
    | SpotLight
    | DirectionalLight
    | ConstantLight
    | EnvironmentMap
    | SunSky
    | Projector
)


# ----------------------------------------------- sensor, film, integrator


@dataclass(frozen=True)
class ReconstructionFilter:
    """`box`, `tent`, `gaussian`, `mitchell`, `catmullrom` or `lanczos`, with parameters."""

    name: str = "gaussian"
    radius: float = 2.0  # [pixels]
    stddev: float = 0.5  # gaussian
    b: float = 1.0 / 3.0  # mitchell
    c: float = 1.0 / 3.0  # mitchell


@dataclass(frozen=True)
class Film:
    """The full picture and the crop window that is rendered, in pixels."""

    width: int = 768
    height: int = 576
    crop_offset_x: int = 0
    crop_offset_y: int = 0
    crop_width: int = 768
    crop_height: int = 576
    rfilter: ReconstructionFilter = ReconstructionFilter()
    sample_border: bool = False  # also sample outside of the crop window, see `border`

    @property
    def border(self) -> int:
        """Number of sampled pixels outside of the crop window, on each side.

        The radius of the filter decides; as in Mitsuba, twice `RayEpsilon` is subtracted.
        """
        if not self.sample_border:
            return 0
        return math.ceil(self.rfilter.radius - 0.5 - 2.0 * NEWEST.ray_epsilon)


@dataclass(frozen=True)
class Sampler:
    """`independent`, `stratified`, `multijitter`, `orthogonal` or `ldsampler`."""

    name: str = "independent"
    sample_count: int = 4
    seed: int = 0
    jitter: bool = True
    strength: int = 2  # orthogonal


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor:
    """Fields of all sensors: they look along local +z; local +x is left, +y is up."""

    to_world: NDArray[np.float64]  # (4, 4)
    near_clip: float = 0.01
    far_clip: float = 1e4
    shutter_time: float = 0.0  # [s] nothing moves, but if not 0 Mitsuba draws a time
    medium: Medium | None = None  # the medium of the camera
    film: Film = Film()
    sampler: Sampler = Sampler()


@dataclass(frozen=True, eq=False, kw_only=True)
class PerspectiveCamera(Sensor):
    """A pinhole camera; `to_world` has no scale."""

    fov_x: float  # [deg] across the full film's width, whatever fov_axis the file used
    principal_point_offset_x: float = 0.0  # in fractions of the film's width
    principal_point_offset_y: float = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class ThinLensCamera(PerspectiveCamera):
    """A camera with a circular lens and a plane of focus."""

    aperture_radius: float
    focus_distance: float  # depth, along local z


@dataclass(frozen=True, eq=False, kw_only=True)
class OrthographicCamera(Sensor):
    """Parallel rays; the film's width covers [-1, 1] of local x."""


AOV_KINDS = (
    "albedo",
    "depth",
    "position",
    "uv",
    "geo_normal",
    "sh_normal",
    "prim_index",
    "shape_index",
)


@dataclass(frozen=True)
class Moments:
    """First and second moments of samples, in additional channels named as by `moment`.

    Channels with `name` have the means of X, Y and Z; those with `m2_` and `name` the means
    of their squares. All names have the prefix `within`.
    """

    name: str  # of the integrator nested in `moment`
    within: str = ""  # "NAME." if `moment` is the child NAME of an `aov`, else ""
    colors: str = ""  # if an `aov` is nested: its child, whose R, G, B are `name.colors`


@dataclass(frozen=True)
class Integrator:
    """`direct`, `path`, `volpath`, ...; each integrator uses some of the fields."""

    name: str = "path"
    max_depth: int = -1  # segments of a path; -1: no limit, 2: direct light only
    rr_depth: int = 5
    hide_emitters: bool = False
    emitter_samples: int = 1  # direct; 0: only BSDF samples
    bsdf_samples: int = 1  # direct; 0: no multiple importance sampling
    cutoff: float = 1.0 / 1024.0  # whitted: rays with a smaller weight end
    aovs: tuple[tuple[str, str], ...] = ()  # aov: (channel name, one of AOV_KINDS)
    block_size: int = 0  # of Mitsuba, which seeds pixels by it; 0 is its default
    one_pass: bool = True  # false if the file gives samples_per_pass
    # path and direct, only in simplified scenes: "lights" or "bsdfs" for only light samples
    # or only BSDF samples; and whether caustic paths are included
    strategy: str = "both"
    caustics: bool = True
    nested: Integrator | None = None  # aov: the integrator of the colours
    moments: Moments | None = None  # set if it is nested in `moment`
    refusal: str = ""  # why it is not supported, "": it is; another integrator may be used
    # volpathmis, which is rendered as volpath except in a replay: pdfs per path, 3 or 1
    mis_densities: int = 0


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A whole scene, with its objects in the order of the file."""

    camera: Sensor
    integrator: Integrator
    shapes: tuple[Shape, ...]
    emitters: tuple[Emitter, ...]  # without area emitters, which are in their shapes
    warnings: tuple[str, ...] = ()  # for the log, such as dropped degenerate triangles
    source: str = "<memory>"
    files: tuple[
        str, ...
    ] = ()  # all files that were read: the scene, includes, meshes, images
    groups: tuple[Group, ...] = ()  # only groups that have instances
    instances: tuple[Instance, ...] = ()
    # for each emitter, the number of `shapes` before it in the file; (): all of them
    emitter_places: tuple[int, ...] = ()
    # names of the emitters after one was removed, since names are numbered; (): unchanged
    emitter_names: tuple[str, ...] = ()
    simplified: tuple[str, ...] = ()  # names of the simplifications that were applied

    @property
    def has_media(self) -> bool:
        """Whether the scene has participating media."""
        bounds = (s.interior or s.exterior for s in self.every_shape)
        return self.camera.medium is not None or any(bounds)

    @property
    def every_shape(self) -> tuple[Shape, ...]:
        """The shapes of the scene, then those of each group, in the order of shape ids."""
        grouped = chain.from_iterable(group.shapes for group in self.groups)
        return (*self.shapes, *grouped)
