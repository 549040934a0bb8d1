"""Scenes without what brings a known fault about.

Each function takes that out of a scene, and tells whether there was such a thing. What the
faults are is in docs/mitsuba-faults.md.
"""

from __future__ import annotations

import copy
from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate.coverage import has
from mitsuba_ref.generate.drawing import plain
from mitsuba_ref.generate.grammar import ENVIRONMENTS

CURVES = ("linearcurve", "bsplinecurve")
CLEAR = (
    "null",
    "mask",
    "dielectric",
    "thindielectric",
    "roughdielectric",
    "principledthin",
)
PLACED = ("filename", "to_world")

SMALL = 0.05
"""Radius of a cylinder below which rounding of its points is seen."""

TIMES = (
    *("latitude", "longitude", "timezone"),
    *("year", "month", "day", "hour", "minute", "second"),
)


def copy_shared_bsdfs(root: Element) -> bool:
    """Replace references to shared BSDFs by copies, so that a fault is undone in some."""
    shared = {bsdf.get("id"): bsdf for bsdf in root.findall("bsdf[@id]")}
    for parent in root.iter():  # a shared one, which may refer to another, stands first
        for ref in parent.findall("ref"):
            if ref.get("id") in shared:
                own = copy.deepcopy(shared[ref.get("id")])
                del own.attrib["id"]
                parent[list(parent).index(ref)] = own
    for bsdf in shared.values():
        root.remove(bsdf)
    return len(shared) > 0


def show_emitters(root: Element) -> bool:
    """Show lamps to camera rays, which then pass none, and are not moved by doing so."""
    found = False
    for integrator in list(root.iter("integrator")):
        for child in integrator.findall("boolean[@name='hide_emitters']"):
            found = found or child.get("value") == "true"
            integrator.remove(child)
    return found


def take_bumps_off_normal_maps(root: Element) -> bool:
    """Leave out bump maps inside of normal maps.

    This fault is ours: our bumps are those of the surface, Mitsuba's of the turned frame.
    """
    outer = [e for e in root.iter("bsdf") if e.get("type") == "normalmap"]
    return sum(map(_take_bumps_off, outer)) > 0


def take_bumps_off_shapes_without_uv(root: Element) -> bool:
    """Leave out bump maps where dp/du is 0: what the normal is there, rounding decides."""
    without = [e for e in root.iter("shape") if e.get("type") in ("linearcurve", "sdfgrid")]
    return sum(map(_take_bumps_off, without)) > 0


def take_bumps_off_mirrored_rectangles(root: Element) -> bool:
    """Leave out bump maps where the geometric and the shading normal are opposite."""
    return sum(map(_take_bumps_off, _mirrored_rectangles(root))) > 0


def mirror_no_rectangles(root: Element) -> bool:
    """Leave mirrored rectangles unmirrored where the picture shows geometric normals."""
    mirrored = _mirrored_rectangles(root) if _shows_aov(root, "geo_normal") else []
    placed = "transform[@name='to_world']/scale"
    for scale in (scale for shape in mirrored for scale in shape.findall(placed)):
        for axis, text in scale.attrib.items():
            scale.set(axis, text.replace("-", ""))
    return len(mirrored) > 0


def turn_bumpy_shapes(root: Element) -> bool:
    """Turn shapes with bump maps by three degrees, so that no u runs along z."""
    shapes = [
        e for e in root.iter("shape") if e.find(".//bsdf[@type='bumpmap']") is not None
    ]
    shapes = [shape for shape in shapes if shape.get("type") != "shapegroup"]
    turned = {"x": "0.6", "y": "0.8", "angle": "3"}
    if root.find(".//rotate[@x='0.6'][@y='0.8'][@angle='3']") is not None:
        return False
    for shape in shapes:
        SubElement(_transform(shape, "to_world"), "rotate", turned)
    return len(shapes) > 0


def _transform(element: Element, name: str) -> Element:
    """Return the transform of this name, a new one if there is none."""
    found = element.find(f"transform[@name='{name}']")
    return SubElement(element, "transform", name=name) if found is None else found


def _shows_aov(root: Element, kind: str) -> bool:
    """Tell whether the picture is an AOV of this kind."""
    shown = root.find("integrator[@type='aov']/string[@name='aovs']")
    return shown is not None and kind in shown.get("value", "")


def _mirrored_rectangles(root: Element) -> list[Element]:
    """Return the rectangles whose geometric and shading normals are opposite in Mitsuba."""
    rectangles = [s for s in root.iter("shape") if s.get("type") == "rectangle"]
    return [shape for shape in rectangles if _is_mirrored(shape)]


def _is_mirrored(shape: Element) -> bool:
    """Tell whether an odd number of factors of its scales is negative."""
    factors = [
        float(number)
        for scale in shape.findall("transform/scale")
        for text in scale.attrib.values()
        for number in text.replace(",", " ").split()
    ]
    return sum(factor < 0.0 for factor in factors) % 2 == 1


def _take_bumps_off(outer: Element) -> bool:
    found = False
    for parent in list(outer.iter()):
        for bump in parent.findall("bsdf[@type='bumpmap']"):
            parent[list(parent).index(bump)] = bump.findall("bsdf")[0]
            found = True
    return found


def coat_lamps_in_media(root: Element) -> bool:
    """Take BSDFs that transmit light off lamps in scenes with media.

    Lamps with a medium inside keep theirs: otherwise no path would enter that medium.
    This fault is ours: the last bit of a hit decides there whether a path that a medium
    has scattered sees the lamp, and phase functions are not rounded as Mitsuba's.
    """
    if root.find(".//medium") is None:
        return False
    clear = [
        (lamp, bsdf)
        for lamp in root.findall(".//shape[emitter]")
        for bsdf in lamp.findall("bsdf")
        if lamp.find("medium") is None and any(has(lamp, "bsdf", kind) for kind in CLEAR)
    ]
    for lamp, bsdf in clear:
        lamp.remove(bsdf)
    return len(clear) > 0


def close_the_room(root: Element) -> bool:
    """Add a faint environment to a scene with holes.

    Without one `path` drops what has met nothing but holes, which a trace does not follow.
    """
    holes = any(has(root, "bsdf", name) for name in ("null", "mask", "thindielectric"))
    if not holes or any(has(root, "emitter", name) for name in ENVIRONMENTS):
        return False
    faint = Element("emitter", type="constant")
    faint.append(plain("float", "radiance", 1e-4))
    root.append(faint)
    return True


def leave_out_strands(root: Element) -> bool:
    """Leave out B-spline curves.

    This fault is ours: inside of a bend that is tighter than the curve is thick, hits are
    lost.
    """
    found = False
    for parent in list(root.iter()):
        for shape in parent.findall("shape[@type='bsplinecurve']"):
            if parent.get("type") == "shapegroup" and len(parent.findall("shape")) == 1:
                shape.set("type", "linearcurve")
            else:
                parent.remove(shape)
            found = True
    return found


def widen_the_scene(root: Element) -> bool:
    """Put a speck far away, so that shadow rays to lights at infinity are hardly turned.

    They end two radii of the scene away, in a direction from where they would start without
    the ray offset.
    """
    lit = any(has(root, "emitter", name) for name in (*ENVIRONMENTS, "directional"))
    if not lit or root.find("shape[@id='speck']") is not None:
        return False
    speck = SubElement(root, "shape", type="disk", id="speck")
    transform = SubElement(speck, "transform", name="to_world")
    SubElement(transform, "scale", value="0.001")
    SubElement(transform, "translate", y="-1e6")
    return True


def coat_lamps(root: Element) -> bool:
    """Leave out BSDFs and media of spheres that shine: nothing goes through them then.

    In a scene with media, where paths scatter inside of them too, they do not shine.
    """
    kinds = ("bsdf", "medium", *(["emitter"] if _has_media_and_lights(root) else []))
    lamps = root.findall(".//shape[@type='sphere'][emitter]")
    inside = [(lamp, e) for lamp in lamps for kind in kinds for e in lamp.findall(kind)]
    for lamp, element in inside:
        lamp.remove(element)
    return len(inside) > 0


def _has_media_and_lights(root: Element) -> bool:
    return root.find(".//medium") is not None and root.find("emitter") is not None


def move_textures_of_curves(root: Element) -> bool:
    """Move textures by a hundredth, so that no texel ends where a piece of a curve does.

    All of the ball at a joint has one v, and rounding says on which side of the edge.
    """
    found = False
    for curve in root.iter("shape"):
        if curve.get("type") not in CURVES:
            continue
        for texture in curve.iter("texture"):
            if texture.get("type") in ("bitmap", "checkerboard"):
                transform = _transform(texture, "to_uv")
                if transform.find("translate[@y='0.0137']") is None:
                    SubElement(transform, "translate", y="0.0137")
                    found = True
    return found


def turn_lamps_back(root: Element) -> bool:
    """Place spheres that shine a picture without turning or mirroring them."""
    found = False
    for shape in root.iter("shape"):
        if shape.get("type") == "sphere" and shape.find("emitter/texture") is not None:
            for transform in shape.findall("transform"):
                for step in transform.findall("rotate"):
                    transform.remove(step)
                    found = True
                for scale in transform.findall("scale"):
                    found = found or "-" in scale.get("value", "")
                    scale.set("value", scale.get("value", "").replace("-", ""))
    return found


def leave_out_curves(root: Element) -> bool:
    """Make curves cylinders, whose points lie on the rays that hit them."""
    curves = [c for kind in CURVES for c in _strip_plugins(root, "shape", kind, *PLACED)]
    for curve in curves:
        curve.set("type", "cylinder")
    return len(curves) > 0


def leave_out_small_cylinders(root: Element) -> bool:
    """Make cylinders spheres where their radius is far from 1.

    Their points are put onto the surface by 1 less the distance in units of the radius, as
    if that were a length in the world.
    """
    found = False
    for tube in root.iter("shape"):
        if tube.get("type") != "cylinder":
            continue
        radius = tube.find("float[@name='radius']")
        scale = tube.find("transform/scale")
        text = "1" if radius is None else radius.get("value", "")
        text = text if scale is None else scale.get("value", "").split(",")[0]
        if float(text) < SMALL:
            tube.set("type", "sphere")
            for child in list(tube):
                if child.get("name") in ("p0", "p1"):
                    tube.remove(child)
            found = True
    return found


def jitter(root: Element) -> bool:
    """Let samplers jitter: without it numbers lie on the edges of choices, as 1 / 2."""
    found = False
    for flag in root.findall(".//sampler/boolean[@name='jitter'][@value='false']"):
        flag.set("value", "true")
        found = True
    for count in root.findall(".//sampler/integer[@name='sample_count']") if found else []:
        count.set("value", "16")  # a defect would show in more samples as well
    return found


def end_paths(root: Element) -> bool:
    """Give paths a depth: roulette may never end one by the numbers of `ldsampler`."""
    found = False
    for integrator in root.iter("integrator"):
        if integrator.get("type") in ("path", "volpath") and has(
            root, "sampler", "ldsampler"
        ):
            depths = integrator.findall("integer[@name='max_depth']")
            if not depths or depths[0].get("value") == "-1":
                for depth in depths:
                    integrator.remove(depth)
                integrator.append(plain("integer", "max_depth", "30"))
                found = True
    return found


def show_no_normals_of_bumps(root: Element) -> bool:
    """Take bump maps off where the picture is an AOV: its normals are not in the world."""
    return _shows_aov(root, "sh_normal") and _take_bumps_off(root)


def point_to_the_sun(root: Element) -> bool:
    """Give the sun a direction instead of place and time, which round in the sines."""
    skies = root.findall("emitter[@type='sunsky']")
    skies = [sky for sky in skies if sky.find("vector[@name='sun_direction']") is None]
    for sky in skies:
        for child in [child for child in sky if child.get("name") in TIMES]:
            sky.remove(child)
        sky.append(Element("vector", name="sun_direction", value="0.4, 0.3, 0.85"))
    return len(skies) > 0


def even_the_sun(root: Element) -> bool:
    """Let the sun be as bright at its rim as in its middle.

    180 roundings of a cosine lie between the two, and the radiance falls off steeply.
    """
    found = False
    for flag in root.findall("emitter[@type='sunsky']/boolean[@name='complex_sun']"):
        found = found or flag.get("value") == "true"
        flag.set("value", "false")
    return found


def unblend_principled(root: Element) -> bool:
    """Make `principled` diffuse in blends.

    From behind it chooses no direction, but says that it has chosen one with a density.
    """
    blends = _strip_plugins(root, "bsdf", "blendbsdf")
    inside = [
        bsdf for blend in blends for bsdf in _strip_plugins(blend, "bsdf", "principled")
    ]
    for bsdf in inside:
        bsdf[:] = []
        bsdf.set("type", "diffuse")
    return len(inside) > 0


def keep_all_digits_of_texels(root: Element) -> bool:
    """Keep texels in single precision.

    16 bits become half floats, and where a texel lies halfway between two of them, the
    rounding of its linear value decides: of 65,536 texels 48 are rounded the other way.
    """
    bitmaps = _strip_plugins(root, "texture", "bitmap", "format")
    for bitmap in bitmaps:
        bitmap.append(plain("string", "format", "variant"))
    return len(bitmaps) > 0


def blacken_rough_plastics(root: Element) -> bool:
    """Leave out what lies under a rough plastic's coat.

    Its tables are sums of 1024 and 16,384 numbers in single precision there.
    """
    plastics = _strip_plugins(root, "bsdf", "roughplastic", "diffuse_reflectance")
    for bsdf in plastics:
        bsdf.append(plain("float", "diffuse_reflectance", "0"))
    return len(plastics) > 0


def make_distances_cubes(root: Element) -> bool:
    """Make grids of distances cubes: their hits are found to 1e-5 of the scene's unit."""
    grids = _strip_plugins(root, "shape", "sdfgrid", "filename", "normals")
    for grid in grids:
        grid.set("type", "cube")
        transform = _transform(grid, "to_world")
        # a grid reaches from 0 to 1 along each axis, a cube from -1 to 1
        transform.insert(0, Element("translate", value="1, 1, 1"))
        transform.insert(1, Element("scale", value="0.5"))
    return len(grids) > 0


def even_the_sky(root: Element) -> bool:
    """Leave out environment maps: directions lie between texels of nearly equal light.

    The place between them is a difference over a difference, which keeps few digits.
    """
    maps = root.findall("emitter[@type='envmap']")
    for sky in maps:
        sky.set("type", "constant")
        for child in list(sky):
            sky.remove(child)
    return len(maps) > 0


def thin_the_media(root: Element) -> bool:
    """Make media of a quarter of their density, so that no transmittance is below 2^-126.

    Whether such numbers count as 0 is a setting of the thread that renders a block.
    """
    media = root.findall(".//medium")
    for medium in media:
        scale = medium.find("float[@name='scale']")
        if scale is None:
            scale = SubElement(medium, "float", name="scale", value="1")
        scale.set("value", str(float(scale.get("value", "1")) / 4.0))
    return len(media) > 0


def take_nearest_cells(root: Element) -> bool:
    """Take extinctions from the nearest cell of their grid.

    Between equal cells an interpolated one is rounded: below the majorant in one renderer,
    equal to it in the other. Then a null collision there has a share of 1e-7, or none.
    """
    grids = root.findall(".//medium/volume[@type='gridvolume'][@name='sigma_t']")
    for grid in grids:
        for old in grid.findall("string[@name='filter_type']"):
            grid.remove(old)
        SubElement(grid, "string", name="filter_type", value="nearest")
    return len(grids) > 0


def _strip_plugins(root: Element, tag: str, kind: str, *without: str) -> list[Element]:
    """Take properties of these names off the elements of one plugin; return those."""
    found = [element for element in root.iter(tag) if element.get("type") == kind]
    for element in found:
        for child in [c for c in element if c.get("name") in without]:
            element.remove(child)
    return found


def show_emitters_to_instances(root: Element) -> bool:
    """Show lamps to camera rays where there are instances."""
    return has(root, "shape", "instance") and show_emitters(root)
