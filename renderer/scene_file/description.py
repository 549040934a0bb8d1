"""SceneDescription: what a scene file says, checked and with every default filled in.

The reader (this package) writes it, `renderer.scene.scene` turns it into the flat arrays of
the kernels. All records are plain data. Transforms map local to world coordinates and
act on column vectors; colours are linear sRGB; angles are degrees, as in the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]


@dataclass(frozen=True)
class Location:
    """Where an element stands, for error messages; `line` is 0 for a dictionary."""

    file: str
    line: int

    def __str__(self) -> str:
        """Return `file:line`, the form that editors can jump to."""
        return f"{self.file}:{self.line}" if self.line else self.file


NOWHERE = Location("<memory>", 0)


# ---------------------------------------------------------------- textures


@dataclass(frozen=True)
class ConstantTexture:
    """One colour everywhere."""

    rgb: Rgb


@dataclass(frozen=True, eq=False)
class BitmapTexture:
    """An image over (u, v); row 0 of `pixels`, the last of the file, is v near 1."""

    pixels: NDArray[np.float32]  # (H, W, 3), linear, already out of sRGB unless `raw`
    filter_type: Literal["bilinear", "nearest"] = "bilinear"
    wrap_mode: Literal["repeat", "mirror", "clamp"] = "repeat"
    to_uv: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))  # on (u, v, 1)


@dataclass(frozen=True, eq=False)
class CheckerboardTexture:
    """Two colours in a 2 x 2 pattern per unit square of the transformed (u, v)."""

    color0: Rgb = (0.4, 0.4, 0.4)
    color1: Rgb = (0.2, 0.2, 0.2)
    to_uv: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))


Texture = ConstantTexture | BitmapTexture | CheckerboardTexture


# ------------------------------------------------------------------- BSDFs


@dataclass(frozen=True, eq=False)
class Diffuse:
    """Lambert: reflectance / pi on the front side, black on the back."""

    plugin: ClassVar[str] = "diffuse"
    reflectance: Texture = ConstantTexture((0.5, 0.5, 0.5))


@dataclass(frozen=True, eq=False)
class Dielectric:
    """Smooth glass; `eta` is the interior over the exterior index of refraction."""

    plugin: ClassVar[str] = "dielectric"
    eta: float = 1.5046 / 1.000277
    specular_reflectance: Rgb = (1.0, 1.0, 1.0)
    specular_transmittance: Rgb = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Conductor:
    """Smooth metal, one-sided; `material` "none" is eta 0, k 1: reflects everything."""

    plugin: ClassVar[str] = "conductor"
    eta: Rgb
    k: Rgb
    specular_reflectance: Rgb = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class OtherBsdf:
    """A kind that was registered: its parameters are attributes, as of the others."""

    plugin: str
    values: Mapping[str, Texture | float]

    def __getattr__(self, name: str) -> Texture | float:
        """Return a parameter."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None


@dataclass(frozen=True, eq=False)
class TwoSided:
    """One reflecting BSDF for each side; given once in the file, it serves both."""

    front: Diffuse | Conductor | OtherBsdf
    back: Diffuse | Conductor | OtherBsdf


Bsdf = Diffuse | Dielectric | Conductor | OtherBsdf | TwoSided


# ------------------------------------------------------------------ shapes


@dataclass(frozen=True, eq=False)
class Program:
    """A function of x, y, z: operations in the order in which a stack takes them."""

    operations: NDArray[np.int32]  # (n,) see `objects.expressions`
    operands: NDArray[np.float64]  # (n,) value of a constant, exponent of a power
    text: str  # where it comes from


@dataclass(frozen=True, eq=False, kw_only=True)
class Shape:
    """What all shapes share."""

    bsdf: Bsdf
    radiance: Rgb | None = None  # of an area emitter on it, on the side of the normal
    id: str = ""
    location: Location = NOWHERE


@dataclass(frozen=True, eq=False, kw_only=True)
class Mesh(Shape):
    """Triangles in world space (obj, ply, cube); `flip_normals` is already applied."""

    vertices: NDArray[np.float32]  # (V, 3) finite
    faces: NDArray[np.int32]  # (F, 3) in [0, V), no degenerate ones
    normals: NDArray[np.float32] | None = None  # (V, 3) unit; None: face normals
    uvs: NDArray[np.float32] | None = None  # (V, 2)
    face_ids: NDArray[np.int32] | None = None  # (F,) index in the file; None: 0..F-1
    flip_normals: bool = False  # the geometric normal is -(e1 x e2)


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
    """Where a function of local x, y, z is 0, inside of a box; its gradient is outwards."""

    to_world: NDArray[np.float64]  # (4, 4)
    bounds: NDArray[np.float64]  # (2, 3) lower and upper corner of the box, local
    program: Program
    flip_normals: bool = False


# ---------------------------------------------------- groups and instances


@dataclass(frozen=True, eq=False)
class Group:
    """Shapes that are seen through instances only; none of them emits light."""

    shapes: tuple[Shape, ...]  # at least one
    id: str = ""
    location: Location = NOWHERE


@dataclass(frozen=True, eq=False)
class Instance:
    """A copy of a group, placed in the world."""

    group: int  # index in `SceneDescription.groups`
    to_world: NDArray[np.float64]  # (4, 4) of the whole group
    place: int  # among the scene's shapes and instances in the file, the first is 0
    id: str = ""
    location: Location = NOWHERE


# ---------------------------------------------------------------- emitters


@dataclass(frozen=True)
class PointLight:
    """Radiant intensity `intensity` [W/sr] in all directions."""

    position: tuple[float, float, float]  # world
    intensity: Rgb


@dataclass(frozen=True, eq=False)
class SpotLight:
    """Shines along local +z; full up to `beam_width`, linear in angle to `cutoff_angle`."""

    to_world: NDArray[np.float64]  # (4, 4)
    intensity: Rgb
    cutoff_angle: float = 20.0  # [deg], half angle
    beam_width: float = 15.0  # [deg], half angle; Mitsuba's default is 3/4 of the cutoff


@dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along `direction` (unit, world)."""

    direction: tuple[float, float, float]
    irradiance: Rgb  # on a plane perpendicular to it


@dataclass(frozen=True)
class ConstantLight:
    """The same radiance from every direction, infinitely far away."""

    radiance: Rgb


Emitter = PointLight | SpotLight | DirectionalLight | ConstantLight


# ----------------------------------------------- sensor, film, integrator


@dataclass(frozen=True)
class ReconstructionFilter:
    """`box`, `tent`, `gaussian`, `mitchell`, `catmullrom` or `lanczos` and its numbers."""

    name: str = "gaussian"
    radius: float = 2.0  # [pixels], where the filter ends
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
    """What all sensors share: they look along local +z; local +x points left, +y up."""

    to_world: NDArray[np.float64]  # (4, 4)
    near_clip: float = 0.01
    far_clip: float = 1e4
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
    """A camera with a round lens in place of the pinhole, and its plane of focus."""

    aperture_radius: float
    focus_distance: float  # depth, along local z


@dataclass(frozen=True, eq=False, kw_only=True)
class OrthographicCamera(Sensor):
    """Parallel rays; the film's width covers [-1, 1] of local x, its height follows."""


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
class Integrator:
    """`direct`, `whitted`, `path`, `depth` or `aov`; each uses the fields it needs."""

    name: str = "path"
    max_depth: int = -1  # segments of a path; -1 is no limit, 2 is direct light alone
    rr_depth: int = 5
    hide_emitters: bool = False
    emitter_samples: int = 1  # direct
    bsdf_samples: int = 1  # direct; 0 is no multiple importance sampling
    cutoff: float = 1.0 / 1024.0  # whitted: a ray of less weight than this is dropped
    aovs: tuple[tuple[str, str], ...] = ()  # aov: (channel name, one of AOV_KINDS)
    block_size: int = 0  # of Mitsuba's work; 0 is its default. It decides pixels' seeds
    one_pass: bool = True  # false where the file gives samples_per_pass
    nested: Integrator | None = None  # aov: the integrator whose colours come first


@dataclass(frozen=True, eq=False)
class SceneDescription:
    """A whole scene, in the order of the file."""

    camera: Sensor
    integrator: Integrator
    shapes: tuple[Shape, ...]
    emitters: tuple[Emitter, ...]  # without the area emitters, which are on their shapes
    warnings: tuple[str, ...] = ()  # what the log says: degenerate triangles dropped, ...
    source: str = "<memory>"
    files: tuple[
        str, ...
    ] = ()  # everything that was read: the scene, includes, meshes, images
    groups: tuple[Group, ...] = ()  # those that have instances
    instances: tuple[Instance, ...] = ()
    # of each emitter, how many of `shapes` come before it in the file; (): all of them
    emitter_places: tuple[int, ...] = ()

    @property
    def every_shape(self) -> tuple[Shape, ...]:
        """The shapes of the scene, then those of each group: the order of shape ids."""
        grouped = chain.from_iterable(group.shapes for group in self.groups)
        return (*self.shapes, *grouped)
