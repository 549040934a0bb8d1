"""Render a scene file in Mitsuba's `scalar_rgb`, in this process, into float32 arrays."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.records.request import OF_FILE, RenderRequest
from mitsuba_ref.reference.edited_scene import load_edited_scene
from mitsuba_ref.reference.errors import MitsubaRefused
from mitsuba_ref.reference.plugins.known_faults import TURNED, turn_normals_of_bump_maps
from mitsuba_ref.reference.user_plugins import twins_explained
from mitsuba_ref.reference.variant import load_mitsuba, set_threads
from renderer.integrators.kind import as_picture
from renderer.scene_file.description import AOV_KINDS

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Reference:
    """What Mitsuba rendered, and under which circumstances."""

    # "pixels" (H, W, 3) and those AOVs that the file lists, or one for each AOV kind
    arrays: dict[str, Array]
    seconds: float  # rendering alone, without loading the scene
    threads: int
    spp: int
    integrator: str  # the plugin's name
    changes: tuple[str, ...]  # what was rendered otherwise than the file says
    from_cache: bool = False

    @property
    def pixels(self) -> Array:
        """The picture, (H, W, 3), linear sRGB."""
        return self.arrays["pixels"]

    @property
    def note(self) -> str:
        """One sentence for the report."""
        return "Changed on Mitsuba's side: " + "; ".join(self.changes) + "."


def render_reference(request: RenderRequest) -> Reference:
    """Render `request` with Mitsuba.

    Raises
    ------
    MitsubaRefused
        With Mitsuba's own sentence, when it refuses the scene.
    """
    mi = load_mitsuba()
    threads = set_threads(request.threads)
    wants_aovs = request.kind == "aovs"
    try:
        edited = load_edited_scene(
            Path(request.path),
            request.parameters,
            box_filter=request.box_filter or wants_aovs,
            pixel_centres=wants_aovs,
            keep_shapes_apart=wants_aovs or request.replay,
            fixed_blocks=request.replay,
            independent_samples=request.independent,
            # a replay has Mitsuba's densities on both sides
            unsampled_lamps=request.unsampled_lamps and not (request.replay or wants_aovs),
            volpath_since=request.volpath_since * (not (request.replay or wants_aovs)),
            last_lobe=request.last_lobe and not (request.replay or wants_aovs),
            plugins=request.plugins,
        )
        scene = edited.scene
        integrator = _aov_integrator(mi) if wants_aovs else scene.integrator()
        sensor = scene.sensors()[0]
        spp = 1 if wants_aovs else request.spp or sensor.sampler().sample_count()
        start = time.perf_counter()
        with twins_explained(request.plugins):
            image = mi.render(
                scene, sensor=sensor, integrator=integrator, spp=spp, seed=request.seed
            )
        seconds = time.perf_counter() - start
    except (RuntimeError, MemoryError) as error:
        raise MitsubaRefused(_one_line(str(error))) from None
    pixels = np.array(image, dtype=np.float32)
    if wants_aovs:
        arrays = _split_aovs(integrator, pixels)
    else:
        names = integrator.aov_names()
        listed = listed_aovs(names, pixels)
        # a film of rgba has as many channels as names where an integrator is inside
        inside = any(name.endswith(".A") for name in names)
        alone = edited.integrator == "aov" and not inside
        first = as_picture(next(iter(listed.values()))) if alone else pixels[..., :3]
        arrays = {"pixels": first} | listed
    changes = edited.changes
    if wants_aovs and edited.bump_maps:
        if turn_normals_of_bump_maps(mi, scene, arrays["sh_normal"]):
            changes += (TURNED,)
    if request.replay:
        arrays["camera"] = camera_entries(mi, sensor)
    return Reference(
        arrays=arrays,
        seconds=seconds,
        threads=threads,
        spp=int(sensor.sampler().sample_count()),
        integrator="aov" if wants_aovs else edited.integrator,
        changes=changes,
    )


def camera_entries(mi: Any, sensor: Any) -> Array:
    """Return what of the matrix from the crop window to the camera a replay rounds by."""
    # with it comes Numba: 0.4 s, for which no other picture of Mitsuba's has to wait
    from renderer.replay.camera import ENTRIES

    film = sensor.film()
    window = (film.size(), film.crop_size(), film.crop_offset())
    planes = (sensor.near_clip(), sensor.far_clip())
    parameters = mi.traverse(sensor)
    if "x_fov" in parameters:
        to_window = mi.perspective_projection(*window, parameters["x_fov"], *planes)
    else:
        to_window = mi.orthographic_projection(*window, *planes)
    matrix = np.array(to_window.inverse().matrix, np.float32)
    return np.array([matrix[entry] for entry in ENTRIES], np.float32)


def _aov_integrator(mi: Any) -> Any:
    return mi.load_dict({"type": "aov", "aovs": ",".join(f"{k}:{k}" for k in AOV_KINDS)})


def listed_aovs(names: Sequence[str], pixels: Array) -> dict[str, Array]:
    """Return the AOVs (H, W, C) that an integrator adds to its colours, by `OF_FILE` name.

    Parameters
    ----------
    names
        Of the last channels, "name.X" and so on. Colours of integrators inside have an
        alpha among these names, and none in a film of three colours; they are left out.
    pixels
        (H, W, channels).
    """
    channels: dict[str, list[int]] = {}
    for number, channel in enumerate(names):
        channels.setdefault(channel.rpartition(".")[0], []).append(number - len(names))
    colours = {name.removesuffix(".A") for name in names if name.endswith(".A")}
    return {
        OF_FILE + name: np.ascontiguousarray(pixels[..., numbers])
        for name, numbers in channels.items()
        if name not in colours
    }


def _split_aovs(integrator: Any, pixels: Array) -> dict[str, Array]:
    """Cut the channels `kind.X`, `kind.Y`, ... into one array for each kind."""
    kinds = [name.split(".")[0] for name in integrator.aov_names()]
    return {
        kind: np.ascontiguousarray(pixels[..., [k == kind for k in kinds]])
        for kind in dict.fromkeys(kinds)
    }


def _one_line(text: str) -> str:
    return " ".join(text.split())
