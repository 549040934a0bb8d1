"""One camera path written down bounce by bounce, as plain records.

Our kernels (`step_by_step`) and a path tracer over Mitsuba's objects
(`replay.paths.mitsuba_trace`) fill the same records, so that they can be compared. All
vectors are in world space; colours are linear sRGB.
"""

from __future__ import annotations

from dataclasses import dataclass, field

Vector = tuple[float, float, float]
Numbers = dict[str, float]  # name of a random number -> its value in [0, 1)
Weights = dict[str, Vector]  # what a path of `volpathmis` carries besides its throughput

BLACK: Vector = (0.0, 0.0, 0.0)
WHITE: Vector = (1.0, 1.0, 1.0)

PHASE = "phase function"
"""Name of the numbers that choose a direction at a collision."""

DENSITIES = "densities"
"""Of a path if each colour determined its distances, over their mean [Miller2019]."""
LIT, LIT_DENSITIES = "lit throughput", "lit densities"
"""The same path, if its next vertex is found by a light sample; the throughput is divided
by the density of the direction. Left out where lights cannot be sampled."""

# what may end a flight in place of a surface or the sky
COLLISION = "a collision"  # real, in a medium
ENDED = "the path's end"  # Russian roulette, the depth limit, a throughput of 0


@dataclass(frozen=True)
class SampledLight:
    """A light sample at a surface point, and the radiance that it carries."""

    light: str  # "shape 3" (in the file, the first is 1) or "emitter 1" (not on a shape)
    direction: Vector  # unit, towards the light
    distance: float  # infinite for directions and the environment
    pdf: float  # [1/sr] with the choice of the light; 0 for points and directions
    weight: Vector  # radiance over pdf, if nothing is in between
    # to the pixel, if nothing is in between; `volpathmis`: without throughput and weights
    carried: Vector
    blocked: bool | None  # None: not traced, as it would carry no light
    origin: Vector | None = None  # of the shadow ray; None: not traced
    # what media and surfaces on the way let through, in `volpathmis` times what is missing
    passed: Vector = WHITE

    @property
    def contribution(self) -> Vector:
        """What it adds to the pixel."""
        if self.blocked:
            return BLACK
        (x, y, z), (r, g, b) = self.carried, self.passed
        return x * r, y * g, z * b


@dataclass(frozen=True)
class Scattered:
    """The direction that the BSDF or the phase function chose."""

    direction: Vector  # unit
    pdf: float  # [1/sr]; 0 for mirrors and glass
    throughput: Vector  # after this bounce, before roulette
    survived: bool  # Russian roulette
    origin: Vector | None = None  # of the next ray, off the surface; None: not written
    straight: bool = False  # a null BSDF: the density is of the event before
    weights: Weights = field(default_factory=dict)  # of the next ray


@dataclass(frozen=True)
class Bounce:
    """One segment of a path: where it arrived and what happened there."""

    shape: int = 0  # in the file, the first is 1; 0: it hit nothing
    face: int | None = None  # of a mesh; None: a shape without faces
    t: float = 0.0  # length of the segment; infinite: it hit nothing
    position: Vector | None = None
    throughput: Vector = BLACK  # on arrival
    emitted: Vector = BLACK  # what the arrival adds to the pixel
    numbers: Numbers = field(default_factory=dict)
    lights: tuple[SampledLight, ...] = ()
    scattered: Scattered | None = None  # None: the path ends here
    radiance: Vector = BLACK  # of the pixel so far, with this bounce
    left_out: bool = False  # it ends because the rest of the path is known to be dark
    normal: Vector | None = None  # unit, of shading, towards either side; None: no hit
    event: str = ""  # `COLLISION` or `ENDED`, where the flight ended so; `shape` is 0 then
    weights: Weights = field(default_factory=dict)  # on arrival


@dataclass(frozen=True)
class TracedPath:
    """One sample of one pixel."""

    renderer: str
    numbers: Numbers  # of the position on the film
    origin: Vector  # of the camera ray
    direction: Vector  # unit
    bounces: tuple[Bounce, ...] = field(default_factory=tuple)
    in_media: bool = False  # how many random numbers it takes depends on its flights

    @property
    def radiance(self) -> Vector:
        """What the path adds to the pixel."""
        return self.bounces[-1].radiance if self.bounces else BLACK


def light_number(k: int) -> str:
    """Return the name of the numbers of a bounce's light sample k, from 0."""
    return f"light {k + 1}" if k else "light"
