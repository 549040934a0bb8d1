"""Faults of Mitsuba that scenes at random meet: what a scene is without them.

Each function takes out of a scene what brings its fault about, and tells whether there was
such a thing. Headings and reasons are in docs/mitsuba-faults.md.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.etree.ElementTree import Element


def _show_emitters(root: Element) -> bool:
    """Show lamps to camera rays, which then pass none, and are not moved by doing so."""
    found = False
    for integrator in list(root.iter("integrator")):
        for child in integrator.findall("boolean[@name='hide_emitters']"):
            found = found or child.get("value") == "true"
            integrator.remove(child)
    return found


KNOWN_FAULTS: dict[str, Callable[[Element], bool]] = {
    "a hidden lamp moves the ray that passes it": _show_emitters,
}
