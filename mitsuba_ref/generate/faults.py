"""Known faults that scenes at random meet: what each may explain, and how it is undone.

Each function takes what brings its fault about out of a scene; a scene that has no such
thing stays as it is. Headings and reasons are in docs/mitsuba-faults.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate.drawing import plain
from mitsuba_ref.generate.grammar import ENVIRONMENTS
from mitsuba_ref.generate.scene_edits import (
    leave_out,
    mirrored_rectangles,
    plugins,
    put,
    shows_aov,
    take_bumps_off,
    transform_of,
    unmirror,
)
from mitsuba_ref.generate.surface_grammar import FILTERS

NOT_FINITE = "not finite"
MITSUBA_NOT_FINITE = "not finite in Mitsuba"
"""Quantities of a picture with NaN or infinite values: of ours, and of Mitsuba's alone."""

CURVES = ("linearcurve", "bsplinecurve")
CLEAR = (
    *("null", "mask", "dielectric", "thindielectric", "roughdielectric"),
    *("principledthin", *FILTERS),
)

SMALL = 0.05
"""Radius of a cylinder below which rounding of its points is seen."""

TIMES = (
    *("latitude", "longitude", "timezone"),
    *("year", "month", "day", "hour", "minute", "second"),
)

_VALUES = (
    *("throughput after", "unblocked light", "light adds", "emitted", "BSDF pdf"),
    "picture",  # of an integrator without a trace
)
"""What a surface's formula says."""

_IN_MEDIA = ("light passes", "random: bsdf x", "random: phase function x")
"""What a shadow ray meets on its way, and the numbers that come after those it took."""

Undo = Callable[[Element], None]


class KnownFault(NamedTuple):
    """A fault, and how it is undone."""

    name: str
    undo: Undo
    quantities: tuple[str, ...] = ()  # that may differ first; empty: any of a path
    most: float = math.inf  # relative: what that quantity may differ by
    gives_nan: bool = False  # to Mitsuba's picture

    def explains(self, quantity: str, error: float) -> bool:
        """Tell whether a difference that begins so may come from it."""
        if quantity == MITSUBA_NOT_FINITE:
            return self.gives_nan
        if self.most < math.inf and not 0.0 < error <= self.most:
            return False
        if self.quantities:
            return quantity in self.quantities
        return not quantity.startswith("Mitsuba") and quantity != NOT_FINITE


KNOWN_FAULTS: list[KnownFault] = []
"""All of them; the first that explains a difference is the one that is named."""


def known_fault(
    name: str, *quantities: str, most: float = math.inf, gives_nan: bool = False
) -> Callable[[Undo], Undo]:
    """Return what adds a fault, with these fields of `KnownFault` and its function."""

    def add(undo: Undo) -> Undo:
        KNOWN_FAULTS.append(KnownFault(name, undo, quantities, most, gives_nan))
        return undo

    return add


@known_fault("a hidden lamp moves the ray that passes it")
def show_emitters(root: Element) -> None:
    """Show lamps to camera rays, which then pass none, and are not moved by doing so."""
    for integrator in list(root.iter("integrator")):
        if integrator.find("boolean[@name='hide_emitters'][@value='true']") is not None:
            leave_out(integrator, "hide_emitters")


@known_fault("path ends where it hides lamps and meets an instance", "MitsubaCrashed")
def show_emitters_to_instances(root: Element) -> None:
    """Show lamps to camera rays where there are instances."""
    if plugins(root, "shape", "instance"):
        show_emitters(root)


@known_fault("ours: a bump map inside of a normal map")
def take_bumps_off_normal_maps(root: Element) -> None:
    """Leave out bump maps inside of normal maps.

    This fault is ours: our bumps are those of the surface, Mitsuba's of the turned frame.
    """
    for outer in plugins(root, "bsdf", "normalmap"):
        take_bumps_off(outer)


@known_fault(
    "ours: a B-spline curve that is thicker than its bend is round",
    *("hits", "light blocked", "face", "t", "position", "normal", "picture"),
)
def leave_out_strands(root: Element) -> None:
    """Leave out B-spline curves.

    This fault is ours: inside of a bend that is tighter than the curve is thick, hits are
    lost.
    """
    for parent in list(root.iter()):
        for shape in parent.findall("shape[@type='bsplinecurve']"):
            if parent.get("type") == "shapegroup" and len(parent.findall("shape")) == 1:
                shape.set("type", "linearcurve")
            else:
                parent.remove(shape)


@known_fault("a sphere that shines lights itself from inside", gives_nan=True)
def coat_lamps(root: Element) -> None:
    """Leave out BSDFs and media of spheres that shine: nothing goes through them then.

    In a scene with media, where paths scatter inside of them too, they do not shine.
    """
    media_and_lights = has_media(root) and root.find("emitter") is not None
    kinds = ("bsdf", "medium", *(["emitter"] if media_and_lights else []))
    for lamp in root.findall(".//shape[@type='sphere'][emitter]"):
        for inside in [child for child in lamp if child.tag in kinds]:
            lamp.remove(inside)


def has_media(root: Element) -> bool:
    """Tell whether a scene has media."""
    return root.find(".//medium") is not None


@known_fault("a texel that ends at the joint of a curve")
def move_textures_of_curves(root: Element) -> None:
    """Move textures by a hundredth, so that no texel ends where a piece of a curve does.

    All of the ball at a joint has one v, and rounding says on which side of the edge.
    """
    for curve in plugins(root, "shape", *CURVES):
        for texture in plugins(curve, "texture", "bitmap", "checkerboard"):
            transform = transform_of(texture, "to_uv")
            if transform.find("translate[@y='0.0137']") is None:
                SubElement(transform, "translate", y="0.0137")


@known_fault("a picture on a turned sphere is sampled elsewhere")
def turn_lamps_back(root: Element) -> None:
    """Place spheres that shine a picture without turning or mirroring them."""
    for shape in plugins(root, "shape", "sphere"):
        if shape.find("emitter/texture") is not None:
            for transform in shape.findall("transform"):
                for step in transform.findall("rotate"):
                    transform.remove(step)
                for scale in transform.findall("scale"):
                    unmirror(scale)


@known_fault("numbers of ldsampler never end a path", "MitsubaTimeout", "picture")
def end_paths(root: Element) -> None:
    """Give paths a depth: roulette may never end one by the numbers of `ldsampler`."""
    endless = plugins(root, "sampler", "ldsampler")
    for integrator in plugins(root, "integrator", "path", "volpath") if endless else []:
        depth = integrator.find("integer[@name='max_depth']")
        if depth is None or depth.get("value") == "-1":
            put(integrator, "integer", "max_depth", "30")


@known_fault("sh_normal of a bump map", "picture")
def show_no_normals_of_bumps(root: Element) -> None:
    """Take bump maps off where the picture is an AOV: its normals are not in the world."""
    if shows_aov(root, "sh_normal"):
        take_bumps_off(root)


@known_fault("a point on a curve lies off its ray")
def leave_out_curves(root: Element) -> None:
    """Make curves cylinders, whose points lie on the rays that hit them."""
    for curve in plugins(root, "shape", *CURVES):
        leave_out(curve, "filename", "to_world")
        curve.set("type", "cylinder")


@known_fault("points of small cylinders are off the surface")
def leave_out_small_cylinders(root: Element) -> None:
    """Make cylinders spheres where their radius is far from 1.

    Their points are put onto the surface by 1 less the distance in units of the radius, as
    if that were a length in the world.
    """
    for tube in plugins(root, "shape", "cylinder"):
        radius = tube.find("float[@name='radius']")
        scale = tube.find("transform/scale")
        text = "1" if radius is None else radius.get("value", "")
        text = text if scale is None else scale.get("value", "").split(",")[0]
        if float(text) < SMALL:
            tube.set("type", "sphere")
            leave_out(tube, "p0", "p1")


@known_fault("numbers without jitter on the edge of a choice")
def jitter(root: Element) -> None:
    """Let samplers jitter: without it numbers lie on the edges of choices, as 1 / 2."""
    flags = root.findall(".//sampler/boolean[@name='jitter'][@value='false']")
    for flag in flags:
        flag.set("value", "true")
    for count in root.findall(".//sampler/integer[@name='sample_count']") if flags else []:
        count.set("value", "16")  # a defect would show in more samples as well


@known_fault("bumps on a shape without u and v", gives_nan=True)
def take_bumps_off_shapes_without_uv(root: Element) -> None:
    """Leave out bump maps where dp/du is 0: what the normal is there, rounding decides."""
    for shape in plugins(root, "shape", "linearcurve", "sdfgrid"):
        take_bumps_off(shape)


@known_fault("bumps on a mirrored rectangle")
def take_bumps_off_mirrored_rectangles(root: Element) -> None:
    """Leave out bump maps where the geometric and the shading normal are opposite."""
    for shape in mirrored_rectangles(root):
        take_bumps_off(shape)


@known_fault(
    "flat bumps where u runs along z",
    *("goes on", "BSDF direction", *_VALUES),
    gives_nan=True,
)
def turn_bumpy_shapes(root: Element) -> None:
    """Turn shapes with bump maps by three degrees, so that no u runs along z."""
    if root.find(".//rotate[@x='0.6'][@y='0.8'][@angle='3']") is not None:
        return
    for shape in list(root.iter("shape")):
        bumpy = shape.find(".//bsdf[@type='bumpmap']") is not None
        if bumpy and shape.get("type") != "shapegroup":
            turned = {"x": "0.6", "y": "0.8", "angle": "3"}
            SubElement(transform_of(shape, "to_world"), "rotate", turned)


@known_fault("geo_normal of a mirrored rectangle", "picture")
def mirror_no_rectangles(root: Element) -> None:
    """Leave mirrored rectangles unmirrored where the picture shows geometric normals."""
    for shape in mirrored_rectangles(root) if shows_aov(root, "geo_normal") else []:
        for scale in shape.findall("transform[@name='to_world']/scale"):
            unmirror(scale)


@known_fault(
    "ours: a lamp that lets light through, met by paths that a medium has scattered",
    "picture",
)
def coat_lamps_in_media(root: Element) -> None:
    """Take BSDFs that transmit light off lamps in scenes with media.

    Lamps with a medium inside keep theirs: otherwise no path would enter that medium.
    This fault is ours: the last bit of a hit decides there whether a path that a medium
    has scattered sees the lamp, and phase functions are not rounded as Mitsuba's.
    """
    for lamp in root.findall(".//shape[emitter]") if has_media(root) else []:
        if lamp.find("medium") is None and plugins(lamp, "bsdf", *CLEAR):
            for bsdf in lamp.findall("bsdf"):
                lamp.remove(bsdf)


@known_fault("light behind holes is dropped, which no trace shows")
def close_the_room(root: Element) -> None:
    """Add a faint environment to a scene with holes.

    Without one `path` drops what has met nothing but holes, which a trace does not follow.
    """
    holes = plugins(root, "bsdf", "null", "mask", "thindielectric", *FILTERS)
    if holes and not plugins(root, "emitter", *ENVIRONMENTS):
        faint = SubElement(root, "emitter", type="constant")
        faint.append(plain("float", "radiance", 1e-4))


@known_fault(
    "principled in a blend, seen from behind",
    *("throughput after", "BSDF pdf", "picture"),
)
def unblend_principled(root: Element) -> None:
    """Make `principled` diffuse in blends.

    From behind it chooses no direction, but says that it has chosen one with a density.
    """
    for blend in plugins(root, "bsdf", "blendbsdf"):
        for bsdf in plugins(blend, "bsdf", "principled"):
            bsdf[:] = []
            bsdf.set("type", "diffuse")


@known_fault(
    "a sun by place and time, to 2e-5",
    *("light direction", "emitted", "unblocked light", "light adds", "picture"),
)
def point_to_the_sun(root: Element) -> None:
    """Give the sun a direction instead of place and time, which round in the sines."""
    for sky in root.findall("emitter[@type='sunsky']"):
        if sky.find("vector[@name='sun_direction']") is None:
            leave_out(sky, *TIMES)
            sky.append(plain("vector", "sun_direction", "0.4, 0.3, 0.85"))


@known_fault("the rim of a complex sun, in roundings of a cosine")
def even_the_sun(root: Element) -> None:
    """Let the sun be as bright at its rim as in its middle.

    180 roundings of a cosine lie between the two, and the radiance falls off steeply.
    """
    for flag in root.findall("emitter[@type='sunsky']/boolean[@name='complex_sun']"):
        flag.set("value", "false")


@known_fault("a texel halfway between two half floats", *_VALUES, most=1e-3)
def keep_all_digits_of_texels(root: Element) -> None:
    """Keep texels in single precision.

    16 bits become half floats, and where a texel lies halfway between two of them, the
    rounding of its linear value decides: of 65,536 texels 48 are rounded the other way.
    """
    for bitmap in plugins(root, "texture", "bitmap"):
        put(bitmap, "string", "format", "variant")


@known_fault("a rough plastic's tables, added up in single precision", *_VALUES, most=3e-5)
def blacken_rough_plastics(root: Element) -> None:
    """Leave out what lies under a rough plastic's coat.

    Its tables are sums of 1024 and 16,384 numbers in single precision there.
    """
    for bsdf in plugins(root, "bsdf", "roughplastic"):
        put(bsdf, "float", "diffuse_reflectance", "0")


@known_fault(
    "hits of a grid of distances, to 1e-5",
    *("t", "position", "normal", "unblocked light"),
    most=1.9e-3,
)
def make_distances_cubes(root: Element) -> None:
    """Make grids of distances cubes: their hits are found to 1e-5 of the scene's unit."""
    for grid in plugins(root, "shape", "sdfgrid"):
        leave_out(grid, "filename", "normals")
        grid.set("type", "cube")
        transform = transform_of(grid, "to_world")
        # a grid reaches from 0 to 1 along each axis, a cube from -1 to 1
        transform.insert(0, Element("translate", value="1, 1, 1"))
        transform.insert(1, Element("scale", value="0.5"))


@known_fault(
    "a direction between texels of nearly equal light", "light direction", most=1.9e-3
)
def even_the_sky(root: Element) -> None:
    """Leave out environment maps: directions lie between texels of nearly equal light.

    The place between them is a difference over a difference, which keeps few digits.
    """
    for sky in root.findall("emitter[@type='envmap']"):
        sky.set("type", "constant")
        sky[:] = []


@known_fault("a null collision of a share of 1e-7, or of none", *_IN_MEDIA, "light blocked")
def take_nearest_cells(root: Element) -> None:
    """Take extinctions from the nearest cell of their grid.

    Between equal cells an interpolated one is rounded: below the majorant in one renderer,
    equal to it in the other. Then a null collision there has a share of 1e-7, or none.
    """
    for grid in root.findall(".//medium/volume[@type='gridvolume'][@name='sigma_t']"):
        put(grid, "string", "filter_type", "nearest")


@known_fault("a transmittance of about 2^-126, by the thread", "throughput", "light passes")
def thin_the_media(root: Element) -> None:
    """Make media of a quarter of their density, so that no transmittance is below 2^-126.

    Whether such numbers count as 0 is a setting of the thread that renders a block.
    """
    for medium in root.findall(".//medium"):
        scale = medium.find("float[@name='scale']")
        if scale is None:
            scale = SubElement(medium, "float", name="scale", value="1")
        scale.set("value", str(float(scale.get("value", "1")) / 4.0))
