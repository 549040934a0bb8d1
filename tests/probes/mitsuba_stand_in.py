"""Mitsuba in the place of our renderer: what a perfect renderer would hand over.

The harness is tested with it, so that its tests do not depend on the renderer, and so
that an error can be injected with a known size. `scaled` injects one into our renderer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from mitsuba_ref.our_renderer.picture import OurPicture, RenderOurs, render_ours
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.errors import MitsubaRefused
from mitsuba_ref.reference.render import render_reference
from renderer.errors import SceneError

Change = Callable[[np.ndarray], np.ndarray]


def stand_in(change: Change = lambda array: array, *, aovs_too: bool = False) -> RenderOurs:
    """Return a renderer that is Mitsuba, its picture (and AOVs) changed by `change`."""

    def render(request: RenderRequest) -> OurPicture:
        try:
            rendered = render_reference(replace(request, threads=2))
        except MitsubaRefused as error:  # a renderer refuses in its own name
            raise SceneError(str(error)) from None
        arrays = rendered.arrays
        if request.kind == "image" or aovs_too:
            arrays = {name: change(array) for name, array in arrays.items()}
        return OurPicture(
            arrays=arrays,
            spp=rendered.spp,
            files=(request.path,),
            seconds=rendered.seconds,
            threads=rendered.threads,
            integrator="stand-in",
        )

    return render


def scaled(factor: float, *, replay: bool = False) -> RenderOurs:
    """Return our renderer with a factor on its pictures, in replays or in all others."""

    def render(request: RenderRequest) -> OurPicture:
        ours = render_ours(request)
        if request.kind != "image" or request.replay != replay:
            return ours
        return replace(ours, arrays={"pixels": np.float32(factor) * ours.pixels})

    return render


SCENE = """<scene version="3.0.0">
  <default name="spp" value="16"/>
  <default name="width" value="32"/>
  <default name="height" value="24"/>
  <integrator type="{integrator}"/>
  <sensor type="perspective">
    <float name="fov" value="40"/>
    <transform name="to_world">
      <lookat origin="0.3, 1.2, 5" target="0, 0.4, 0" up="0, 1, 0"/>
    </transform>
    <film type="hdrfilm">
      <integer name="width" value="$width"/>
      <integer name="height" value="$height"/>
      <rfilter type="box"/>
    </film>
    {sampler}
  </sensor>
  <bsdf type="diffuse" id="red">
    <rgb name="reflectance" value="0.6, 0.3, 0.2"/>
  </bsdf>
  <shape type="rectangle">
    <transform name="to_world">
      <scale value="4"/>
      <rotate x="1" angle="-90"/>
      <translate y="-1"/>
    </transform>
    <ref id="red"/>
  </shape>
  <shape type="sphere">
    <ref id="red"/>
  </shape>
  {emitter}
</scene>
"""
NOISY = SCENE.format(
    integrator="path",
    sampler='<sampler type="independent">'
    '<integer name="sample_count" value="$spp"/></sampler>',
    emitter='<emitter type="constant"><rgb name="radiance" value="0.8, 0.9, 1"/></emitter>',
)
PROOF = """title = "A sphere on a plane"
shows = "nothing but the harness"
deterministic = {deterministic}
[demo]
width = 32
height = 24
spp = 16
[test]
width = {width}
height = {height}
spp = {spp}
[tolerance]
rmse_factor = 1.25
reason = "both sides are Mitsuba"
"""
STILL = SCENE.format(
    integrator="direct",
    sampler='<sampler type="stratified"><boolean name="jitter" value="false"/>'
    '<integer name="sample_count" value="$spp"/></sampler>',
    emitter='<emitter type="point"><point name="position" value="2, 4, 3"/>'
    '<rgb name="intensity" value="20"/></emitter>',
)


def write_scene(
    folder: Path,
    *,
    deterministic: bool = False,
    width: int = 48,
    height: int = 36,
    spp: int = 64,
) -> Path:
    """Write a scene and its proof.toml into `folder`; return the scene's path."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = folder / "scene.xml"
    scene.write_text(STILL if deterministic else NOISY)
    (folder / "proof.toml").write_text(
        PROOF.format(
            deterministic=str(deterministic).lower(),
            width=width,
            height=height,
            spp=1 if deterministic else spp,
        )
    )
    return scene
