"""The picture of the integrator nested in `aov`, in addition to the AOVs."""

from __future__ import annotations

import dataclasses

from renderer.rendering.picture.image import Image
from renderer.rendering.planning.make_plan import plan_with
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene
from renderer.scene_file.description import Integrator


def nested_scene(scene: Scene, plan: Plan) -> Scene | None:
    """Return the scene whose picture the `aov` integrator shows; None if it shows none.

    It is the same scene with the nested integrator and the same seed. So its camera rays
    are those of the AOVs, as in Mitsuba.
    """
    nested = scene.description.integrator.nested
    if plan.method != "aov" or nested is None:
        return None
    found: Scene = scene.once("colours with AOVs", _under, scene, nested)
    return found


def _under(scene: Scene, integrator: Integrator) -> Scene:
    description = dataclasses.replace(scene.description, integrator=integrator)
    return dataclasses.replace(scene, description=description)


def plans_of(scene: Scene, options: RenderOptions) -> list[tuple[Scene, Plan]]:
    """Return the scenes to render: the scene itself, and for AOVs one for the colours.

    The colours have their own integrator.

    Raises
    ------
    SceneError
        As `make_plan`.
    """
    plan = plan_with(scene, options)
    nested = nested_scene(scene, plan)
    if nested is None:
        return [(scene, plan)]
    of_colors = dataclasses.replace(options, integrator=None)
    return [(scene, plan), (nested, plan_with(nested, of_colors))]


def with_picture(image: Image, picture: Image) -> Image:
    """Return an image of AOVs with the nested integrator's colours as its pixels."""
    return dataclasses.replace(
        image,
        pixels=picture.pixels,
        spp=picture.spp,
        requested_spp=picture.requested_spp,
        samples=image.samples + picture.samples,
        aovs={**picture.aovs, **image.aovs},
        aov_kinds={**picture.aov_kinds, **image.aov_kinds},
        seconds=image.seconds + picture.seconds,
        compile_seconds=image.compile_seconds + picture.compile_seconds,
        metadata={**picture.metadata, **image.metadata},
        explain=f"{image.explain}\n\nthe nested integrator's colours\n{picture.explain}",
        complete=image.complete and picture.complete,
    )
