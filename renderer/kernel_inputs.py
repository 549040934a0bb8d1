"""From scene and plan to the kernels' record: what is needed, None for the rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from renderer.accelerators.build import build_accelerators
from renderer.camera import kernel_camera
from renderer.kernel_scene import DIFFUSE, Bsdfs, KernelScene, Settings, Surfaces
from renderer.light_tables import light_tables
from renderer.materials import shape_stages
from renderer.plan import RAY_OFFSETS, Plan, stratified_cells
from renderer.replay.numbers import ROWS, Replay
from renderer.replay.pixel_seeds import pixel_seeds
from renderer.replay.sequences import make_sequence
from renderer.replay.surfaces import replay_surfaces
from renderer.replay.triangle_arithmetic import face_normals, triangle_tangents
from renderer.sampling import Independent, Stratified
from renderer.scene import KINDS, Scene


def kernel_sampler(plan: Plan, seed: int) -> Any:
    """Return the sampler's record; the file's own seed and the render's are mixed."""
    mixed = int(np.random.SeedSequence([plan.sampler.seed, seed]).generate_state(1)[0])
    name = plan.sampler.name
    if name == "independent":
        return Independent(mixed)
    columns, rows = stratified_cells(plan.spp)
    jitter = 1.0 if plan.sampler.jitter else 0.0
    return Stratified(mixed, columns, rows, jitter, None if name == "stratified" else 1)


def replay_sampler(scene: Scene, plan: Plan, seed: int) -> Replay:
    """Return Mitsuba's own numbers for a scene, by pixel of the full film."""
    film = scene.description.camera.film
    seeds = np.zeros((film.height, film.width), np.uint32)
    rows = slice(film.crop_offset_y, film.crop_offset_y + film.crop_height)
    columns = slice(film.crop_offset_x, film.crop_offset_x + film.crop_width)
    seeds[rows, columns] = pixel_seeds(film.crop_width, film.crop_height, seed)
    direct = plan.method == "direct"
    smooth = [bool(shape_stages(s) & DIFFUSE) for s in scene.description.every_shape]
    return Replay(
        make_sequence(seeds.ravel(), plan.sampler),
        np.zeros((ROWS, seeds.size), np.float32),
        np.array(smooth or [False], np.int32),
        1 if plan.bsdf_samples else None,
        1 if direct else None,
    )


def _bsdfs(scene: Scene, plan: Plan) -> Bsdfs:
    """Return the tables of the BSDFs that the plan's paths go on from."""
    bsdfs = scene.materials.records()
    return bsdfs if plan.mirrors else bsdfs._replace(conductor=None, dielectric=None)


def kernel_scene(
    scene: Scene,
    plan: Plan,
    accel: str,
    seed: int,
    measured_camera: Sequence[float] | None = None,
) -> KernelScene:
    """Assemble what the kernels of a plan may look at.

    `measured_camera` is for a replay, see `replay.camera.replay_camera`.
    """
    first_hit = plan.method in ("depth", "aov")
    counted = plan.method == "work"
    with_uv = (scene.materials.textured or first_hit) and not counted
    surfaces: dict[str, Any] = dict.fromkeys(KINDS)
    surfaces.update(scene.surfaces)
    if surfaces["triangles"] is not None and not with_uv:
        surfaces["triangles"] = surfaces["triangles"]._replace(uvs=None)
    if surfaces["triangles"] is not None and plan.replay:
        triangles = scene.surfaces["triangles"]
        surfaces["triangles"] = surfaces["triangles"]._replace(
            normal=face_normals(triangles.edge1, triangles.edge2),
            tangents=triangle_tangents(triangles),
        )
    accelerators = build_accelerators(scene, accel, plan.rays)
    seen = None
    if plan.hide_emitters:
        seen = build_accelerators(scene, accel, plan.rays, without_emitters_of=accelerators)
    settings = Settings(
        plan.max_depth,
        plan.roulette_depth,
        1 if plan.weigh else None,
        1 if plan.every_light else None,
        1 if plan.follow else None,
        1 if plan.hide_emitters else 0,
        plan.cutoff,
        *RAY_OFFSETS[plan.ray_offset],
        1 if plan.replay else None,
    )
    return KernelScene(
        accelerators,
        seen,
        Surfaces(**surfaces, with_uv=1 if with_uv else None),
        scene.stages,
        scene.shape,
        scene.face,
        scene.shapes,
        _bsdfs(scene, plan),
        None if first_hit or counted else light_tables(scene, plan.replay),
        kernel_camera(scene.description.camera),
        replay_sampler(scene, plan, seed) if plan.replay else kernel_sampler(plan, seed),
        settings,
        replay_surfaces(scene.description, measured_camera) if plan.replay else None,
    )
