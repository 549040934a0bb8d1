"""Sensors and integrators of a document."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.process.names import INTEGRATORS
from renderer.scene_file.coordinate_limits import check_camera
from renderer.scene_file.description import Integrator, Sensor
from renderer.scene_file.files import Reading
from renderer.scene_file.numbers import parse_float
from renderer.scene_file.objects.films import read_film, read_sampler
from renderer.scene_file.objects.media import read_medium
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element

# ------------------------------------------------------------------------------ sensors
# Properties of all sensors, including the variants of the field of view.

_SCALE = 1e-3  # tolerance for to_world to be a rotation; Mitsuba's value
_DIAGONAL_35MM = math.hypot(36.0, 24.0)  # [mm], of the film that `focal_length` refers to


def read_sensor(element: Element, reading: Reading) -> Sensor:
    """Read a `<sensor>`.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    properties = Properties(element, reading)
    sensor: Sensor = registered_kinds("sensor")[element.plugin].read(properties)
    properties.finish()
    check_camera(sensor, properties)
    return sensor


def shared(properties: Properties) -> dict[str, Any]:
    """Return the fields of all kinds of sensor except `to_world`, by name."""
    reading = properties.reading
    film = read_film(properties.child("film"), reading)
    sampler = read_sampler(properties.child("sampler"), reading)
    medium = properties.child("medium")
    near = properties.number("near_clip", 1e-2, above=0.0)
    far = properties.number("far_clip", 1e4)
    if near >= far:
        name = "near_clip" if properties.has("near_clip") else "far_clip"
        properties.fail(
            name, f"near_clip {near:g} and far_clip {far:g}", "near_clip < far_clip"
        )
    # Nothing moves, so the shutter has no effect; its times must be in order.
    opens = properties.number("shutter_open", 0.0)
    closes = properties.number("shutter_close", 0.0)
    if closes < opens:
        name = "shutter_close" if properties.has("shutter_close") else "shutter_open"
        properties.fail(name, f"open {opens:g}, close {closes:g}", "open <= close")
    return {
        "near_clip": near,
        "far_clip": far,
        "shutter_time": closes - opens,
        "medium": None if medium is None else read_medium(medium, reading),
        "film": film,
        "sampler": sampler,
    }


def without_scale(properties: Properties) -> NDArray[np.float64]:
    """Return `to_world`, which must be a rotation and a translation."""
    to_world = properties.transform("to_world")
    linear = to_world[:3, :3]
    if np.abs(linear @ linear.T - np.eye(3)).max() > _SCALE:
        properties.fail(
            "to_world", "a transform that scales or shears", "a rotation and translation"
        )
    return to_world


def read_fov_x(properties: Properties, aspect: float) -> float:
    """Return the horizontal field of view [deg] for a picture of this aspect ratio."""
    if properties.has("fov") and properties.has("focal_length"):
        properties.fail("focal_length", 'a value together with "fov"', "one of the two")
    if properties.has("fov"):
        name, fov = "fov", properties.number("fov", 0.0)
        axis = properties.choice(
            "fov_axis", "x", ("x", "y", "diagonal", "smaller", "larger"), any_case=True
        )
    else:
        if "fov_axis" in properties.element.properties:
            properties.fail("fov_axis", "a value without a fov", 'a "fov" with it')
        name, fov, axis = "focal_length", _focal_length_fov(properties), "diagonal"
    if axis in ("smaller", "larger"):
        axis = "y" if (aspect > 1.0) == (axis == "smaller") else "x"
    half = math.tan(0.5 * math.radians(fov)) if 0.0 < fov < 180.0 else math.nan
    if axis == "y":
        half *= aspect
    elif axis == "diagonal":
        half /= math.hypot(1.0, 1.0 / aspect)
    fov_x = math.degrees(2.0 * math.atan(half))
    # for a smaller angle the inverse of the width overflows float32
    if not 1e-30 < np.float32(fov_x) < 180.0:
        properties.fail(
            name, f"{fov:g} degrees", "a field of view between 0 and 180 degrees"
        )
    return fov_x


def _focal_length_fov(properties: Properties) -> float:
    """Return the diagonal field of view [deg] for a focal length such as `50mm`."""
    text = properties.string("focal_length", "50mm")
    location = properties.location
    if properties.has("focal_length"):
        location = properties.element.properties["focal_length"].location
    length = parse_float(text.removesuffix("mm"), location, "focal_length")
    if length <= 0.0:
        raise SceneError(
            f'{location}: {properties.element}, property "focal_length": found '
            f"{length:g} mm, "
            "expected a length above 0"
        )
    return math.degrees(2.0 * math.atan(_DIAGONAL_35MM / (2.0 * length)))


# -------------------------------------------------------------------------- integrators
# Integrators: the registered ones, and the properties of all of them.
#
# An unsupported integrator is no error yet: the scene can be rendered by another one.

_SAME = {"volpathmis": "volpath"}  # estimators of the same radiance


def read_integrator(
    element: Element | None, reading: Reading, instead: str = "path"
) -> Integrator:
    """Read an `<integrator>`; None is Mitsuba's default, `path` without a depth limit.

    For an unsupported one the properties of all path tracers are read, and `refusal` gives
    the reason.

    Parameters
    ----------
    element, reading
        The element, and the state of the reader.
    instead
        The integrator that renders the scene if this one is not supported.

    Raises
    ------
    SceneError
        If something in it is wrong.
    """
    if element is None:
        return Integrator()
    kinds = registered_kinds("integrator")
    plugin = _SAME.get(element.plugin, element.plugin)
    if plugin not in kinds:
        possible = ", ".join(kinds)
        why = f"not supported; supported integrator plugins: {possible}"
        return _refused(element, why, instead, reading)
    properties = Properties(dataclasses.replace(element, plugin=plugin), reading)
    integrator: Integrator = kinds[plugin].read(properties)
    mis_densities = 0
    if plugin != element.plugin:
        properties.element = element  # the one that messages name
        mis_densities = 3 if properties.boolean("use_spectral_mis", True) else 1
    # Mitsuba's division of its work: only used by a replay of its random numbers
    block_size = properties.integer("block_size", 0, at_least=0)
    one_pass = not properties.has("samples_per_pass")
    properties.integer("samples_per_pass", 1, at_least=1)
    timeout = properties.number("timeout", -1.0)
    if timeout > 0.0:
        properties.fail(
            "timeout", f"{timeout:g} s", "none: pictures are always finished here"
        )
    properties.finish()
    return dataclasses.replace(
        integrator,
        mis_densities=mis_densities,
        block_size=block_size,
        one_pass=one_pass,
    )


def _refused(element: Element, why: str, instead: str, reading: Reading) -> Integrator:
    others = ", ".join(name for name in INTEGRATORS if name not in ("auto", instead))
    kept = {
        name: property_
        for name, property_ in element.properties.items()
        if name in ("max_depth", "rr_depth", "hide_emitters")
    }
    usual = dataclasses.replace(element, plugin="path", properties=kept)
    try:
        known: Integrator = registered_kinds("integrator")["path"].read(
            Properties(usual, reading)
        )
    except SceneError:  # these properties may have another meaning there
        known = Integrator()
    return dataclasses.replace(
        known,
        name=element.plugin,
        refusal=f"{element.location}: {element} is {why}; --integrator {instead}, or in "
        f'Python render(scene, integrator="{instead}"), renders the scene with {instead} '
        f"({others} are possible too)",
    )
