"""The scene itself: sorts its children into a SceneDescription."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from renderer.errors import SceneError
from renderer.scene_file.description import Emitter, SceneDescription
from renderer.scene_file.objects.bsdfs import read_bsdf
from renderer.scene_file.objects.emitters import read_emitter
from renderer.scene_file.objects.groups import SPECIAL, read_shapes
from renderer.scene_file.objects.textures import read_texture_plugin
from renderer.scene_file.objects.view.films import read_film, read_rfilter
from renderer.scene_file.objects.view.integrators import read_scene_integrator
from renderer.scene_file.objects.view.samplers import read_sampler
from renderer.scene_file.objects.view.sensors import read_sensor
from renderer.scene_file.plugins import (
    UNSUPPORTED_TAGS,
    registered_kinds,
    supported_plugins,
)
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element


def read_scene(root: Element, source: str, reading: Reading) -> SceneDescription:
    """Read the root element, with its references resolved.

    Raises
    ------
    SceneError
        If anything in it is wrong, whether it is used or not, as in Mitsuba, or what is
        used is not supported.
    """
    if root.tag != "scene":
        raise SceneError(f"{root.location}: the root is {root}; expected a scene")
    properties = Properties(root, reading)
    # What Mitsuba's ray tracing kernels are told; the kernels here have one mode.
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
    method = read_scene_integrator(integrator, root, reading)
    if (method.nested or method).hide_emitters:
        _check_hidden(properties)
    description = SceneDescription(
        camera=camera,
        integrator=method,
        shapes=shapes,
        groups=groups,
        instances=instances,
        emitters=tuple(emitter for emitter, _ in emitters),
        emitter_places=tuple(place for _, place in emitters),
        warnings=tuple(dict.fromkeys(reading.warnings)),
        source=source,
        files=tuple(reading.files),
    )
    return description


def _emitters(root: Element, properties: Properties) -> list[tuple[Emitter, int]]:
    """Return the emitters, and how many surfaces come before each in the file."""
    reading, kinds = properties.reading, registered_kinds("emitter")
    properties.children("emitter")
    emitters: list[tuple[Emitter, int]] = []
    environment = None
    surfaces = 0
    for child in (property_.value for property_ in root.properties.values()):
        if not isinstance(child, Element) or child.tag not in ("emitter", "shape"):
            continue
        element = child if child.tag == "emitter" else _emitter_beside(child)
        if element is not None and (emitter := read_emitter(element, reading)) is not None:
            _check_place(element, child, reading)
            emitters.append((emitter, surfaces))
            if kinds[element.plugin].environment:
                if environment is not None:
                    raise SceneError(
                        f"{element.location}: {element} is a second environment beside "
                        f"line {environment.location.line}; expected at most one"
                    )
                environment = element
        surfaces += child.tag == "shape" and child.plugin not in SPECIAL
    return emitters


def _emitter_beside(shape: Element) -> Element | None:
    """Return the emitter inside of a shape that does not make its surface shine."""
    kinds = registered_kinds("emitter")
    for child in (property_.value for property_ in shape.properties.values()):
        if isinstance(child, Element) and child.tag == "emitter":
            kind = kinds.get(child.plugin)
            return None if kind is None or kind.on_shapes else child
    return None


def _check_hidden(properties: Properties) -> None:
    """Refuse what Mitsuba hides though it does not shine: a shape with a point light."""
    for _, shape in properties.children("shape"):
        if (inside := _emitter_beside(shape)) is not None:
            raise SceneError(
                f"{inside.location}: {inside} in a shape beside hide_emitters, which would "
                "hide the shape; expected it outside of the shape"
            )


def _check_place(element: Element, where: Element, reading: Reading) -> None:
    """Refuse an emitter that is the scene's and a shape's: Mitsuba would count it twice."""
    if element is where and id(element) in reading.owners:
        shape = reading.owners[id(element)]
        raise SceneError(
            f"{shape.location}: {element} of line {element.location.line} lights the scene "
            "already; only an area emitter can be referred to by a shape"
        )


def _read_unused(properties: Properties) -> None:
    """Read what stands in the scene to be referenced, after what may refer to it."""
    reading = properties.reading
    readers: dict[str, Callable[[Element, Reading], Any]] = {
        "bsdf": read_bsdf,
        "texture": read_texture_plugin,
        "film": read_film,
        "rfilter": read_rfilter,
        "sampler": read_sampler,
    }
    for tag, read in readers.items():
        for _, element in properties.children(tag):
            reading.read_unused(element, read)
    for tag in UNSUPPORTED_TAGS:  # what refers to them refuses them
        for _, element in properties.children(tag):
            reading.warn(element.location, f"{element} is not read: no {tag} is used here")
