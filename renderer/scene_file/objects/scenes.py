"""Reads a whole scene from its elements: objects, groups and instances, in file order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from renderer.errors import SceneError
from renderer.scene_file.description import (
    Emitter,
    Group,
    Instance,
    Integrator,
    Mesh,
    SceneDescription,
    Shape,
)
from renderer.scene_file.files import Reading
from renderer.scene_file.objects.films import read_film, read_rfilter, read_sampler
from renderer.scene_file.objects.media import read_medium, read_phase, read_volume
from renderer.scene_file.objects.objects import (
    read_bsdf,
    read_emitter,
    read_shape,
    read_texture_plugin,
)
from renderer.scene_file.objects.sensors import read_integrator, read_sensor
from renderer.scene_file.plugins import (
    UNSUPPORTED_TAGS,
    registered_kinds,
    supported_plugins,
)
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element

# ------------------------------------------------------------------------------- groups
# Groups and instances: shapes that are stored once and placed many times.
#
# A `shapegroup` is not visible itself; each `instance` shows all its shapes. As in Mitsuba,
# groups cannot be nested and have no emitters.

SPECIAL = ("shapegroup", "instance")  # shape plugins without a surface


def read_shapes(
    scene: Properties,
) -> tuple[tuple[Shape, ...], tuple[Group, ...], tuple[Instance, ...]]:
    """Read all shapes of a scene; return plain shapes, groups and instances.

    A group without an instance is read, so that its errors are reported, and left out.

    Raises
    ------
    SceneError
        If anything in them is invalid or not supported.
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
        If it is empty, or contains nothing with an area, an emitter, an instance or a
        group.
    """
    properties = Properties(element, reading)
    properties.number("silhouette_sampling_weight", 1.0)  # only for derivatives
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
    """Refuse shapes that Mitsuba does not allow in groups."""
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


# ------------------------------------------------------------------------------- scenes
# The scene: sorts its children into a SceneDescription.


def read_scene(root: Element, source: str, reading: Reading) -> SceneDescription:
    """Read the root element, with its references resolved.

    Raises
    ------
    SceneError
        If anything in it is invalid, even if unused, as in Mitsuba; or if anything used is
        not supported.
    """
    if root.tag != "scene":
        raise SceneError(f"{root.location}: the root is {root}; expected a scene")
    properties = Properties(root, reading)
    # Options of Mitsuba's ray tracing kernels, without effect here.
    properties.boolean("embree_use_robust_intersections", False)
    properties.boolean("allow_thread_reordering", True)
    integrator = properties.child("integrator")
    sensors = [element for _, element in properties.children("sensor")]
    camera = read_sensor(sensors[0], reading) if sensors else None
    for element in sensors[1:]:
        reading.read_unused(element, read_sensor)
    shapes, groups, instances = read_shapes(properties)
    emitters = _emitters(root, properties)
    _read_unused(properties)
    properties.finish()
    if camera is None:
        raise SceneError(
            f"{root.location}: the scene has no <sensor>; expected one of "
            f"{', '.join(supported_plugins('sensor'))}"
        )
    if len(sensors) > 1:
        reading.warn(
            root.location, f"{len(sensors)} sensors; the first one takes the picture"
        )
    description = SceneDescription(
        camera=camera,
        integrator=Integrator(),
        shapes=shapes,
        groups=groups,
        instances=instances,
        emitters=tuple(emitter for emitter, _ in emitters),
        emitter_places=tuple(place for _, place in emitters),
        source=source,
    )
    instead = "volpath" if description.has_media else "path"
    method = read_integrator(integrator, reading, instead)
    inner = method.nested or method
    if inner.hide_emitters:
        _check_hidden(properties)
    kind = registered_kinds("integrator").get(inner.name)
    if description.has_media and not (method.refusal or getattr(kind, "media", False)):
        reading.warn(
            (integrator or root).location,
            f"{integrator or 'path'} ignores the scene's media, as in Mitsuba; volpath "
            "does not",
        )
    return replace(
        description,
        integrator=method,
        warnings=tuple(dict.fromkeys(reading.warnings)),
        files=tuple(reading.files),
    )


def _emitters(root: Element, properties: Properties) -> list[tuple[Emitter, int]]:
    """Return the emitters, and the number of surfaces before each in the file."""
    reading, kinds = properties.reading, registered_kinds("emitter")
    properties.children("emitter")
    emitters: list[tuple[Emitter, int]] = []
    environment = None
    surfaces = 0
    for child in (property_.value for property_ in root.properties.values()):
        if not isinstance(child, Element) or child.tag not in ("emitter", "shape"):
            continue
        element = child if child.tag == "emitter" else _emitter_inside(child)
        if element is not None and (emitter := read_emitter(element, reading)) is not None:
            _check_place(element, child, reading)
            emitters.append((emitter, surfaces))
            if kinds[element.plugin].environment:
                if environment is not None:
                    raise SceneError(
                        f"{element.location}: {element} is a second environment, after "
                        f"line {environment.location.line}; expected at most one"
                    )
                environment = element
        surfaces += child.tag == "shape" and child.plugin not in SPECIAL
    return emitters


def _emitter_inside(shape: Element) -> Element | None:
    """Return the emitter inside of a shape that is not an area light."""
    kinds = registered_kinds("emitter")
    for child in (property_.value for property_ in shape.properties.values()):
        if isinstance(child, Element) and child.tag == "emitter":
            kind = kinds.get(child.plugin)
            return None if kind is None or kind.on_shapes else child
    return None


def _check_hidden(properties: Properties) -> None:
    """Refuse `hide_emitters` for shapes with a point light, which Mitsuba hides as well."""
    for _, shape in properties.children("shape"):
        if (inside := _emitter_inside(shape)) is not None:
            raise SceneError(
                f"{inside.location}: {inside} in a shape, together with hide_emitters, "
                "which would hide the shape; expected it outside of the shape"
            )


def _check_place(element: Element, where: Element, reading: Reading) -> None:
    """Refuse an emitter of both scene and shape: Mitsuba would count it twice."""
    if element is where and id(element) in reading.owners:
        shape = reading.owners[id(element)]
        raise SceneError(
            f"{shape.location}: {element} of line {element.location.line} lights the scene "
            "already; only an area emitter can be referred to by a shape"
        )


def _read_unused(properties: Properties) -> None:
    """Read objects for references, after all objects that may refer to them."""
    reading = properties.reading
    readers: dict[str, Callable[[Element, Reading], Any]] = {
        "bsdf": read_bsdf,
        "texture": read_texture_plugin,
        "film": read_film,
        "rfilter": read_rfilter,
        "sampler": read_sampler,
        "medium": read_medium,
        "phase": read_phase,
        "volume": read_volume,
    }
    for tag, read in readers.items():
        for _, element in properties.children(tag):
            reading.read_unused(element, read)
    for tag in UNSUPPORTED_TAGS:  # objects that refer to them report the error
        for _, element in properties.children(tag):
            reading.warn(element.location, f"{element} is not read: no {tag} is used here")
