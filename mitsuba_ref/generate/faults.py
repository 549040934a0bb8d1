"""Known faults that scenes at random meet: what a scene is without them.

Each function takes out of a scene what brings its fault about, and tells whether there was
such a thing. Headings and reasons are in docs/mitsuba-faults.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple
from xml.etree.ElementTree import Element

from mitsuba_ref.generate.coverage import has
from mitsuba_ref.generate.drawing import plain
from mitsuba_ref.generate.grammar import ENVIRONMENTS


class KnownFault(NamedTuple):
    """A fault, and how it is undone."""

    name: str
    undo: Callable[[Element], bool]
    quantities: tuple[str, ...] = ()  # that may differ first; empty: any of a path

    def explains(self, quantity: str) -> bool:
        """Tell whether a difference that begins so may come from it."""
        if self.quantities:
            return quantity in self.quantities
        return not quantity.startswith("Mitsuba")


def _show_emitters(root: Element) -> bool:
    """Show lamps to camera rays, which then pass none, and are not moved by doing so."""
    found = False
    for integrator in list(root.iter("integrator")):
        for child in integrator.findall("boolean[@name='hide_emitters']"):
            found = found or child.get("value") == "true"
            integrator.remove(child)
    return found


def _take_bumps_off_normal_maps(root: Element) -> bool:
    """Leave out bump maps inside of normal maps.

    This fault is ours: our bumps are those of the surface, Mitsuba's of the turned frame.
    """
    outer = [e for e in root.iter("bsdf") if e.get("type") == "normalmap"]
    return sum(map(_take_bumps_off, outer)) > 0


def _take_bumps_off_shapes_without_uv(root: Element) -> bool:
    """Leave out bump maps where dp/du is 0: what the normal is there, rounding decides."""
    without = [e for e in root.iter("shape") if e.get("type") in ("linearcurve", "sdfgrid")]
    return sum(map(_take_bumps_off, without)) > 0


def _take_bumps_off(outer: Element) -> bool:
    found = False
    for parent in list(outer.iter()):
        for bump in parent.findall("bsdf[@type='bumpmap']"):
            parent[list(parent).index(bump)] = bump.findall("bsdf")[0]
            found = True
    return found


def _close_the_room(root: Element) -> bool:
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


def _leave_out_strands(root: Element) -> bool:
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


def _point_to_the_sun(root: Element) -> bool:
    """Give the sun a direction instead of place and time, which round in the sines."""
    found = False
    for sky in root.iter("emitter"):
        if (
            sky.get("type") == "sunsky"
            and sky.find("vector[@name='sun_direction']") is None
        ):
            for child in list(sky):
                if child.get("name") in TIMES:
                    sky.remove(child)
            sky.append(Element("vector", name="sun_direction", value="0.5, 0.3, 0.8"))
            found = True
    return found


def _show_emitters_to_instances(root: Element) -> bool:
    return has(root, "shape", "instance") and _show_emitters(root)


TIMES = (
    *("latitude", "longitude", "timezone"),
    *("year", "month", "day", "hour", "minute", "second"),
)
KNOWN_FAULTS = (
    KnownFault("a hidden lamp moves the ray that passes it", _show_emitters),
    KnownFault(
        "path ends where it hides lamps and meets an instance",
        _show_emitters_to_instances,
        ("MitsubaCrashed",),
    ),
    KnownFault("ours: a bump map inside of a normal map", _take_bumps_off_normal_maps),
    KnownFault(
        "ours: a B-spline curve that is thicker than its bend is round",
        _leave_out_strands,
        ("hits", "light blocked", "face"),
    ),
    KnownFault("bumps on a shape without u and v", _take_bumps_off_shapes_without_uv),
    KnownFault("light behind holes is dropped, which no trace shows", _close_the_room),
    KnownFault(
        "a sun by place and time, to 2e-5",
        _point_to_the_sun,
        ("light direction", "emitted", "unblocked light", "light adds", "picture"),
    ),
)
