"""From the channels of the first-hit integrator to named AOVs."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.integrators import first_hit
from renderer.picture.image import Image
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene
from renderer.scene_file.description import AOV_KINDS

CHANNELS_OF = {  # of the first-hit integrator, by kind of AOV
    "depth": slice(first_hit.DEPTH, first_hit.DEPTH + 1),
    "position": slice(first_hit.POSITION, first_hit.POSITION + 3),
    "uv": slice(first_hit.UV, first_hit.UV + 2),
    "geo_normal": slice(first_hit.GEO_NORMAL, first_hit.GEO_NORMAL + 3),
    "sh_normal": slice(first_hit.SH_NORMAL, first_hit.SH_NORMAL + 3),
    "prim_index": slice(first_hit.PRIM_INDEX, first_hit.PRIM_INDEX + 1),
    "shape_index": slice(first_hit.SHAPE_INDEX, first_hit.SHAPE_INDEX + 1),
    "albedo": slice(first_hit.ALBEDO, first_hit.ALBEDO + 3),
}


def split_channels(
    scene: Scene, plan: Plan, channels: NDArray[np.float32]
) -> tuple[NDArray[np.float32], dict[str, Any], dict[str, str]]:
    """Return (pixels, AOVs by name, their kinds).

    The `depth` integrator's picture is the depth, in all three colours. That of `aov` is
    its nested integrator's, which is rendered apart, so it is black here. A file without
    a list of AOVs gets all kinds, named after themselves.
    """
    depth = channels[..., CHANNELS_OF["depth"]]
    if plan.method == "depth":
        return np.repeat(depth, 3, axis=2), {}, {}
    listed = asked_aovs(scene)
    aovs = {
        name: np.ascontiguousarray(channels[..., CHANNELS_OF[kind]])
        for name, kind in listed
    }
    black = np.zeros((*channels.shape[:2], 3), np.float32)
    return black, aovs, dict(listed)


def asked_aovs(scene: Scene) -> tuple[tuple[str, str], ...]:
    """Return (name, kind) of the AOVs that the file lists; of all kinds if it lists none."""
    asked = scene.description.integrator
    listed = asked.aovs if asked.name == "aov" else ()
    return listed or tuple((kind, kind) for kind in AOV_KINDS)


def nested_scene(scene: Scene, plan: Plan) -> Scene | None:
    """Return the scene whose picture the `aov` integrator shows; None if it shows none.

    It is the same scene under the nested integrator, rendered with the same seed, as in
    Mitsuba: its camera rays are those of the AOVs.
    """
    nested = scene.description.integrator.nested
    if plan.method != "aov" or nested is None:
        return None
    description = dataclasses.replace(scene.description, integrator=nested)
    return dataclasses.replace(scene, description=description)


def with_picture(image: Image, picture: Image) -> Image:
    """Return an image of AOVs with the nested integrator's colours as its pixels."""
    return dataclasses.replace(
        image,
        pixels=picture.pixels,
        aovs={**picture.aovs, **image.aovs},
        aov_kinds={**picture.aov_kinds, **image.aov_kinds},
        seconds=image.seconds + picture.seconds,
        compile_seconds=image.compile_seconds + picture.compile_seconds,
        explain=f"{image.explain}\n\nthe nested integrator's colours\n{picture.explain}",
        complete=image.complete and picture.complete,
    )
