"""Our renderer's side of a comparison, as one function that tests can replace."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitsuba_ref.our_renderer.whole_picture import whole
from mitsuba_ref.records.request import OF_FILE, RenderRequest
from renderer.scene_file.description import (
    AOV_KINDS,
    Integrator,
    ReconstructionFilter,
    SceneDescription,
)
from renderer.scene_file.plugins import import_plugin_file

Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class OurPicture:
    """What our renderer made of a request."""

    # "pixels" (H, W, 3) and those AOVs that the file lists, or one for each AOV kind
    arrays: dict[str, Array]
    spp: int
    files: tuple[str, ...] = ()  # every file that the scene reads
    seconds: float | None = None  # without loading and compiling
    compile_seconds: float | None = None
    threads: int | None = None
    integrator: str = ""
    method: str = ""
    explain: str = ""
    listed: Mapping[str, str] = field(default_factory=dict)  # name of an AOV -> its kind

    @property
    def pixels(self) -> Array:
        """The picture, (H, W, 3), linear sRGB."""
        return self.arrays["pixels"]


METHOD_TOPICS = ("method", "accelerator", "samples")

RenderOurs = Callable[[RenderRequest], OurPicture]


def render_ours(request: RenderRequest, light_choice: str | None = "uniform") -> OurPicture:
    """Render `request` with our renderer.

    Lights are chosen as Mitsuba does it (None: by the renderer's own way): the tests of one
    picture take it for one more of Mitsuba's with another seed, and by importance ours of
    `instances` has 0.4 times its variance in red, 2 times in blue.

    Raises
    ------
    SceneError
        When the scene is not one that we can render.
    KeyboardInterrupt
        After Ctrl-C.
    """
    import renderer
    from renderer.scene.scene import build_scene

    wants_aovs = request.kind == "aovs"
    description = read_scene(request)
    edited = edit_description(
        description,
        box_filter=request.box_filter or wants_aovs,
        first_hits=wants_aovs,
        independent_samples=request.independent,
    )
    image = whole(
        renderer.render(
            build_scene(edited),
            spp=1 if wants_aovs else request.spp,
            seed=request.seed,
            threads=request.threads,
            sampler="mitsuba" if request.replay else None,
            measured_camera=request.camera,
            # Mitsuba's rule: a chain of mirrors shifts by it at each bounce, visibly
            ray_offset="mitsuba",
            light_choice=light_choice,
        )
    )
    arrays = dict(image.aovs)
    listed = {OF_FILE + k: kind for k, kind in image.aov_kinds.items() if kind in AOV_KINDS}
    if not wants_aovs:
        arrays = {OF_FILE + name: values for name, values in image.aovs.items()}
        arrays["pixels"] = np.asarray(image)
    return OurPicture(
        arrays=arrays,
        spp=int(image.spp),
        files=description.files,
        seconds=image.seconds,
        compile_seconds=image.compile_seconds,
        threads=image.threads,
        integrator=image.integrator,
        method=_method(image.explain),
        explain=image.explain,
        listed={} if wants_aovs else listed,
    )


def read_scene(request: RenderRequest) -> SceneDescription:
    """Read the scene of a request, with the user's plugins known.

    Raises
    ------
    SceneError
        When the scene or the file of plugins cannot be read.
    """
    from renderer.scene_file import read_file_with

    if request.plugins is not None:
        import_plugin_file(request.plugins)
    return read_file_with(Path(request.path), request.parameters, request.allow_outside)


def cautions_about(request: RenderRequest) -> tuple[str, ...]:
    """Return what is known to fail in the scene of a request; none if we refuse it."""
    from renderer.advice.all_cautions import cautions_of
    from renderer.rendering.planning.make_plan import make_plan
    from renderer.scene.scene import build_scene

    try:
        scene = build_scene(read_scene(request))
        plan = make_plan(scene)
    except Exception:  # its rendering does the same, and says what is wrong
        return ()
    return tuple(str(caution) for caution in cautions_of(scene, plan))


def _method(explanation: str) -> str:
    """Pick what ran from the lines `topic   text` of the renderer's explanation."""
    lines = (line.partition(" ") for line in explanation.splitlines())
    return "; ".join(text.strip() for topic, _, text in lines if topic in METHOD_TOPICS)


def edit_description(
    description: SceneDescription,
    *,
    box_filter: bool,
    first_hits: bool,
    independent_samples: bool = False,
    colors_alone: bool = False,
) -> SceneDescription:
    """Return the scene with the changes that Mitsuba's side makes too.

    Parameters
    ----------
    description
        As the file says.
    box_filter
        Pixels that share no samples.
    first_hits
        All AOVs, of one ray through the centre of each pixel.
    independent_samples
        The sampler `independent`.
    colors_alone
        The integrator whose colours an `aov` or `moment` shows, instead of these.
    """
    if colors_alone:
        integrator = integrator_of_colors(description.integrator)
        description = dataclasses.replace(description, integrator=integrator)
    camera = description.camera
    if box_filter:
        film = dataclasses.replace(
            camera.film, rfilter=ReconstructionFilter(name="box", radius=0.5)
        )
        camera = dataclasses.replace(camera, film=film)
    if independent_samples:
        sampler = dataclasses.replace(camera.sampler, name="independent")
        camera = dataclasses.replace(camera, sampler=sampler)
    if first_hits:
        sampler = dataclasses.replace(
            camera.sampler, name="stratified", sample_count=1, jitter=False
        )
        camera = dataclasses.replace(camera, sampler=sampler)
        all_kinds = tuple((kind, kind) for kind in AOV_KINDS)
        integrator = Integrator(name="aov", aovs=all_kinds)
        description = dataclasses.replace(description, integrator=integrator)
    return dataclasses.replace(description, camera=camera)


def integrator_of_colors(asked: Integrator) -> Integrator:
    """Return the integrator whose colours `aov` and `moment` show; others as they are."""
    return dataclasses.replace(asked.nested or asked, moments=None)
