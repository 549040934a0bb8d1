"""Groups and instances: shapes that are stored once and placed many times.

A `shapegroup` shows nothing by itself; each `instance` of it shows all its shapes. As in
Mitsuba 3.9.1 there is one level of this, and no group emits light.
"""

from __future__ import annotations

from renderer.errors import SceneError
from renderer.scene_file.description import Group, Instance, Mesh, Shape
from renderer.scene_file.objects.shapes import read_shape
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

SPECIAL = ("shapegroup", "instance")  # the shape plugins that are no surfaces


def read_shapes(
    scene: Properties,
) -> tuple[tuple[Shape, ...], tuple[Group, ...], tuple[Instance, ...]]:
    """Read all shapes of a scene; return its own, its groups and their instances.

    A group without an instance is read, so that its errors show, and left out.

    Raises
    ------
    SceneError
        If anything in them is not supported or wrong.
    """
    elements = [element for _, element in scene.children("shape")]
    reading = scene.reading
    referred = {
        id(property_.value)
        for element in elements
        if element.plugin == "instance"
        for property_ in element.properties.values()
    }
    groups: dict[int, Group] = {}
    for element in elements:
        if element.plugin == "shapegroup" and id(element) in referred:
            groups[id(element)] = read_group(element, reading)
        elif element.plugin == "shapegroup" and (
            group := reading.read_unused(element, read_group)
        ):
            groups[id(element)] = group
    used: dict[int, int] = {}  # id of the group's element -> its number
    shapes: list[Shape] = []
    instances: list[Instance] = []
    for element in elements:
        place = len(shapes) + len(instances)
        if element.plugin == "instance":
            instances.append(_read_instance(element, reading, groups, used, place))
        elif element.plugin != "shapegroup":
            shapes.append(read_shape(element, reading))
    return tuple(shapes), tuple(groups[key] for key in used), tuple(instances)


def read_group(element: Element, reading: Reading) -> Group:
    """Read a shapegroup.

    Raises
    ------
    SceneError
        If it holds nothing, nothing with an area, an emitter, an instance or a group.
    """
    properties = Properties(element, reading)
    properties.number("silhouette_sampling_weight", 1.0)  # for derivatives only
    if properties.has("to_world"):
        properties.transform("to_world")
        reading.warn(
            element.properties["to_world"].location,
            f"to_world of {element} does nothing, as in Mitsuba; "
            "give it to the shapes inside or to the instances",
        )
    children = properties.children("shape")
    for name, child in children:
        _check_member(child, element, name)
    properties.finish()
    if not children:
        raise SceneError(f"{element.location}: {element} is empty; expected shapes in it")
    shapes = tuple(read_shape(child, reading) for _, child in children)
    if all(isinstance(shape, Mesh) and len(shape.faces) == 0 for shape in shapes):
        raise SceneError(
            f"{element.location}: all triangles in {element} are degenerate (no area); at "
            "least one must be left"
        )
    return Group(shapes, element.id, element.location)


def _check_member(child: Element, group: Element, name: str) -> None:
    """Refuse what Mitsuba does not put into groups."""
    where = group.properties[name].location
    if child.plugin in SPECIAL:
        raise SceneError(
            f"{where}: {child} inside {group}; groups do not nest, expected a shape with a "
            "surface (place each shape by its own to_world)"
        )
    for property_ in child.properties.values():
        if isinstance(property_.value, Element) and property_.value.tag == "emitter":
            raise SceneError(
                f"{property_.location}: {child} emits light inside {group}; expected "
                "shapes that do not (place lights in the scene, not in a group)"
            )


def _read_instance(
    element: Element,
    reading: Reading,
    groups: dict[int, Group],
    used: dict[int, int],
    place: int,
) -> Instance:
    properties = Properties(element, reading)
    properties.number("silhouette_sampling_weight", 1.0)
    children = properties.children("shape")
    for name, child in children:
        if id(child) not in groups:
            known = ", ".join(group.id for group in groups.values() if group.id) or "none"
            raise SceneError(
                f"{element.properties[name].location}: {element} holds {child}; expected a "
                f"<ref> to a shapegroup of this scene: {known}"
            )
    to_world = properties.transform("to_world")
    properties.finish()
    if len(children) != 1:
        raise SceneError(
            f"{element.location}: {element} has {len(children)} shapegroups; "
            "expected a <ref> to one"
        )
    group = used.setdefault(id(children[0][1]), len(used))
    return Instance(group, to_world, place, element.id, element.location)
