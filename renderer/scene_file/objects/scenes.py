"""The scene itself: sorts its children into a SceneDescription."""

from __future__ import annotations

from functools import partial

from renderer.errors import SceneError
from renderer.scene_file.description import ConstantLight, Emitter, SceneDescription
from renderer.scene_file.document.tree import Element
from renderer.scene_file.objects.bsdfs import read_bsdf
from renderer.scene_file.objects.emitters import read_emitter
from renderer.scene_file.objects.films import read_film, read_rfilter
from renderer.scene_file.objects.groups import SPECIAL, read_shapes
from renderer.scene_file.objects.integrators import read_integrator
from renderer.scene_file.objects.samplers import read_sampler
from renderer.scene_file.objects.sensors import read_sensor
from renderer.scene_file.objects.textures import read_texture_plugin
from renderer.scene_file.plugins import supported_plugins
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading


def read_scene(root: Element, source: str, reading: Reading) -> SceneDescription:
    """Read the root element, with its references resolved.

    Raises
    ------
    SceneError
        If anything in it is not supported or wrong, whether it is used or not, as in
        Mitsuba.
    """
    if root.tag != "scene":
        raise SceneError(f"{root.location}: the root is {root}; expected a scene")
    properties = Properties(root, reading)
    # What Mitsuba's ray tracing kernels are told; the kernels here are always watertight.
    properties.boolean("embree_use_robust_intersections", False)
    properties.boolean("allow_thread_reordering", True)
    integrator = properties.child("integrator")
    sensors = [
        read_sensor(element, reading) for _, element in properties.children("sensor")
    ]
    shapes, groups, instances = read_shapes(properties)
    emitters = _emitters(properties)
    _read_unused(properties)
    properties.finish()
    if not sensors:
        raise SceneError(
            f"{root.location}: the scene has no <sensor>; expected one of "
            f"{', '.join(supported_plugins('sensor'))}"
        )
    if len(sensors) > 1:
        reading.warn(
            root.location, f"{len(sensors)} sensors; the first one takes the picture"
        )
    description = SceneDescription(
        camera=sensors[0],
        integrator=read_integrator(integrator, reading),
        shapes=shapes,
        groups=groups,
        instances=instances,
        emitters=tuple(emitters),
        emitter_places=_emitter_places(root),
        warnings=tuple(dict.fromkeys(reading.warnings)),
        source=source,
        files=tuple(reading.files),
    )
    return description


def _emitters(properties: Properties) -> list[Emitter]:
    emitters: list[Emitter] = []
    for _, element in properties.children("emitter"):
        emitter = read_emitter(element, properties.reading)
        if isinstance(emitter, ConstantLight) and any(
            isinstance(other, ConstantLight) for other in emitters
        ):
            raise SceneError(
                f"{element.location}: a second {element}; expected at most one"
            )
        emitters.append(emitter)
    return emitters


def _emitter_places(root: Element) -> tuple[int, ...]:
    """Return for each emitter how many surfaces come before it in the file."""
    places: list[int] = []
    surfaces = 0
    for child in (property_.value for property_ in root.properties.values()):
        if isinstance(child, Element) and child.tag == "emitter":
            places.append(surfaces)
        elif isinstance(child, Element) and child.tag == "shape":
            surfaces += child.plugin not in SPECIAL
    return tuple(places)


def _read_unused(properties: Properties) -> None:
    """Read what stands in the scene to be referenced, so that its errors show."""
    reading = properties.reading
    for _, element in properties.children("bsdf"):
        read_bsdf(element, reading)
    for _, element in properties.children("texture"):
        reading.once(element, partial(read_texture_plugin, element, reading))
    for _, element in properties.children("film"):
        read_film(element, reading)
    for _, element in properties.children("rfilter"):
        read_rfilter(element, reading)
    for _, element in properties.children("sampler"):
        read_sampler(element, reading)
