"""Scenes as text for the tests of the reader, read by us and by Mitsuba."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
dr.set_thread_count(max(2, dr.thread_count()))  # one worker: EXR files hang in 3.9.1

from renderer import scene_file  # noqa: E402
from renderer.errors import SceneError  # noqa: E402
from renderer.scene_file.description import (  # noqa: E402
    Disk,
    Mesh,
    Rectangle,
    SceneDescription,
    Shape,
    Sphere,
)

SENSOR = '<sensor type="perspective"><float name="fov" value="40"/></sensor>'


def scene_text(content: str, *, sensor: str = SENSOR, version: str = "3.0.0") -> str:
    """Return a scene with one child of `content` on line 2 and a sensor on the last."""
    return f'<scene version="{version}">\n{content}\n{sensor}</scene>'


def ours(content: str, *, folder: Path | None = None, **texts: str) -> SceneDescription:
    return scene_file.read_string(scene_text(content, **texts), base_dir=folder)


def theirs(content: str, *, folder: Path | None = None, **texts: str) -> Any:
    """Load the same scene into Mitsuba, without merging of meshes."""
    text = scene_text(content, **texts)
    if folder is None:
        return mi.load_string(text, optimize=False)
    path = folder / "for_mitsuba.xml"
    path.write_text(text)
    return mi.load_file(str(path), optimize=False)


def in_mitsuba(value):
    """Return the dictionary as Mitsuba's `load_dict` takes it."""
    if isinstance(value, dict):
        return {key: in_mitsuba(item) for key, item in value.items()}
    return mi.ScalarTransform4f(value) if isinstance(value, np.ndarray) else value


def parameter(plugin: Any, name: str) -> np.ndarray:
    """Return a value that Mitsuba's `traverse` shows, as (3,) if it is a colour."""
    value = np.array(mi.traverse(plugin)[name], dtype=np.float64)
    return np.broadcast_to(value, 3) if value.size == 1 else value


def error_of(content: str, **texts: Any) -> str:
    """Return the message of the SceneError that reading must end in.

    It has to be one line and must not come from anything but our own checks.
    """
    try:
        ours(content, **texts)
    except SceneError as error:
        message = str(error)
        assert "\n" not in message
        assert message.startswith(("<string>:", "/"))
        return message
    raise AssertionError(f"no error for {content}")


def mitsuba_refuses(content: str, **texts: Any) -> bool:
    """Tell whether Mitsuba refuses the scene too."""
    try:
        theirs(content, **texts)
    except (RuntimeError, ValueError):
        return True
    return False


def points_on(shape: Shape) -> np.ndarray:
    """Return many points of the surface of an analytic shape, or the mesh's vertices."""
    if isinstance(shape, Mesh):
        return shape.vertices
    t = np.linspace(0.0, 2.0 * np.pi, 721)
    match shape:
        case Rectangle():
            local = np.array([[x, y, 0] for x in (-1, 1) for y in (-1, 1)], float)
        case Disk():
            local = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
        case Sphere():
            linear = shape.to_world[:3, :3]
            extent = np.linalg.norm(linear, axis=1)  # of an ellipsoid along each axis
            return shape.to_world[:3, 3] + np.concatenate(
                [np.diag(extent), -np.diag(extent)]
            )
        case _:
            ring = np.stack([np.cos(t), np.sin(t), 0 * t], axis=1)
            local = np.concatenate([ring, ring + np.array([0, 0, 1])])
    return local @ shape.to_world[:3, :3].T + shape.to_world[:3, 3]
