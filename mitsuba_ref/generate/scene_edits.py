"""What is found in a scene's XML, and changed in it."""

from __future__ import annotations

import copy
from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate.drawing import plain


def plugins(root: Element, tag: str, *kinds: str) -> list[Element]:
    """Return the elements of a tag that are one of these plugins."""
    return [element for element in root.iter(tag) if element.get("type") in kinds]


def leave_out(element: Element, *names: str) -> None:
    """Take the properties of these names off an element."""
    for child in [child for child in element if child.get("name") in names]:
        element.remove(child)


def put(element: Element, tag: str, name: str, value: str) -> None:
    """Give an element a property, in the place of the one that it has."""
    leave_out(element, name)
    element.append(plain(tag, name, value))


def transform_of(element: Element, name: str) -> Element:
    """Return the transform of this name, a new one if there is none."""
    found = element.find(f"transform[@name='{name}']")
    return SubElement(element, "transform", name=name) if found is None else found


def unmirror(scale: Element) -> None:
    """Take the signs off the factors of a scale."""
    for axis, text in scale.attrib.items():
        scale.set(axis, text.replace("-", ""))


def shows_aov(root: Element, kind: str) -> bool:
    """Tell whether the picture is an AOV of this kind."""
    shown = root.find("integrator[@type='aov']/string[@name='aovs']")
    return shown is not None and kind in shown.get("value", "")


def mirrored_rectangles(root: Element) -> list[Element]:
    """Return the rectangles whose geometric and shading normals are opposite in Mitsuba."""
    return [s for s in plugins(root, "shape", "rectangle") if _is_mirrored(s)]


def _is_mirrored(shape: Element) -> bool:
    """Tell whether an odd number of factors of its scales is negative."""
    factors = [
        float(number)
        for scale in shape.findall("transform/scale")
        for text in scale.attrib.values()
        for number in text.replace(",", " ").split()
    ]
    return sum(factor < 0.0 for factor in factors) % 2 == 1


def take_bumps_off(outer: Element) -> None:
    """Leave out bump maps: what is inside of them stays."""
    for parent in list(outer.iter()):
        for bump in parent.findall("bsdf[@type='bumpmap']"):
            parent[list(parent).index(bump)] = bump.findall("bsdf")[0]


def copy_shared_bsdfs(root: Element) -> bool:
    """Replace references to shared BSDFs by copies, so that a fault is undone in some.

    Returns
    -------
    bool
        Whether there were any.
    """
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
