"""One point of a scene, estimated a thousand times over: what a single sample is worth.

Every pixel of a narrow camera looks at the same point, so that the spread over the pixels
of one render is the error of the estimator, with nothing else in it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import renderer
from renderer.kernels.records.kernel_scene import EMIT
from renderer.rendering.job import RenderJob
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.render_loop import run
from renderer.rendering.render_options import RenderOptions

SIZE = 32  # [pixels] each way

_SCENE = """<scene version="3.0.0">
{integrator}
<sensor type="perspective"><float name="fov" value="{fov}"/>
    <float name="far_clip" value="1e9"/>
    <transform name="to_world"><lookat {lookat}/></transform>
    <film type="hdrfilm"><integer name="width" value="{size}"/>
        <integer name="height" value="{size}"/><rfilter type="box"/></film>
    {sampler}</sensor>
{body}
</scene>"""
INDEPENDENT = '<sampler type="independent"/>'
MIDDLES = """<sampler type="stratified"><integer name="sample_count" value="1"/>
    <boolean name="jitter" value="false"/></sampler>"""  # of the pixels


def load_scene(
    body: str,
    lookat: str,
    integrator: str,
    *,
    size: int = SIZE,
    fov: float = 0.001,
    sampler: str = INDEPENDENT,
) -> renderer.Scene:
    """Load what is in `body`; `integrator` and `sampler` are elements."""
    return renderer.load_string(
        _SCENE.format(
            body=body,
            lookat=lookat,
            integrator=integrator,
            size=size,
            fov=fov,
            sampler=sampler,
        )
    )


def scene_at(
    body: str,
    lookat: str,
    *,
    depth: int = 2,
    roulette: int = 1000,
    size: int = SIZE,
    fov: float = 0.001,
    integrator: str = "path",
) -> renderer.Scene:
    """Load what is in `body`, seen by a camera that looks at one point of it."""
    limits = f'<integer name="max_depth" value="{depth}"/>'
    limits += f'<integer name="rr_depth" value="{roulette}"/>'
    loop = f'<integrator type="{integrator}">{limits}</integrator>'
    return load_scene(body, lookat, loop, size=size, fov=fov)


def estimates(
    scene: renderer.Scene,
    spp: int,
    *,
    seed: int = 0,
    integrator: str | None = None,
    light_choice: str | None = None,
) -> NDArray[np.float64]:
    """Return independent estimates of one number, one a pixel, flat."""
    image = renderer.render(
        scene, spp=spp, seed=seed, integrator=integrator, light_choice=light_choice
    )
    return image.pixels[..., 0].astype(np.float64).ravel()


def spread_of_a_sample(values: NDArray[np.float64], spp: int) -> float:
    """Return the standard deviation of a single sample over the mean.

    With n samples the relative error is this over the root of n. Infinite if nothing was
    found at all.
    """
    mean = float(np.mean(values))
    return float(np.std(values)) / mean * spp**0.5 if mean else float("inf")


def by_one_strategy(scene: renderer.Scene, spp: int, strategy: str) -> NDArray[np.float64]:
    """Estimate with one of the two ways to find light alone [Veach1997, section 9.2].

    Parameters
    ----------
    scene : Scene
        Its lamps have an extent, and the camera sees none.
    spp : int
        Samples of each estimate.
    strategy : str
        "lights" asks a lamp at each point and gives what the BSDF finds no weight;
        "bsdf" follows the BSDF and asks no lamp; "both" is the usual combination.
    """
    plan = make_plan(scene, spp=spp, integrator="direct")
    job = RenderJob(scene, plan, RenderOptions(accel="brute", threads=2))
    record = job.kernel_scene
    alone = record.settings._replace(weigh=0)
    if strategy == "lights":
        # nothing is found by arriving: no primitive is marked as one that shines
        stages = record.primitives.stages & ~np.int32(EMIT)
        primitives = record.primitives._replace(stages=stages)
        record = record._replace(settings=alone, primitives=primitives)
    elif strategy == "bsdf":
        # the BSDFs at which lamps are sampled come first: here these are none
        record = record._replace(settings=alone, bsdfs=record.bsdfs._replace(smooth=0))
    film = job.make_film()
    run(job.with_record(record), film)
    return np.asarray(film.develop())[..., 0].astype(np.float64).ravel()
