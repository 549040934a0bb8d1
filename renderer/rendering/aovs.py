"""The picture of the integrator inside of `aov`, beside which the AOVs stand."""

from __future__ import annotations

import dataclasses

from renderer.picture.image import Image
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene


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
