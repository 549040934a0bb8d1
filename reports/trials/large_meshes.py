"""Two scenes that are too large to lie in a folder: written when they are measured.

A ball of 327,680 triangles, the largest mesh of the study of accelerators: under a sun, and
between a floor and a lamp with light over five bounces. The first has noise at edges alone
and next to nothing to shade, so that its seconds are those of rays in a large mesh, of the
film, and of whatever is done once a picture.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.trials.meshes import View, displaced_icosphere

FREQUENCY = 128  # 327,680 triangles
SIZE = 1280, 720

_SUN = """<emitter type="directional">
    <vector name="direction" value="-0.5, 0.6, -1"/>
    <rgb name="irradiance" value="3"/>
  </emitter>"""
_FLOOR_AND_LAMP = """<shape type="rectangle">
    <transform name="to_world"><scale value="6"/><translate z="-1.4"/></transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
  </shape>
  <shape type="rectangle">
    <transform name="to_world">
      <lookat origin="2, -2, 4" target="0, 0, 0" up="0, 1, 0"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="12"/></emitter>
  </shape>"""
# name -> depth of its paths, and what is added to the ball; a depth of 6 is 5 bounces
LARGE = {"ball-and-sun": (2, _SUN), "ball-and-lamp": (6, _FLOOR_AND_LAMP)}


@contextmanager
def written(names: list[str], frequency: int = FREQUENCY) -> Iterator[list[Path]]:
    """Write scenes of `LARGE` to a folder that is there as long as the context.

    Parameters
    ----------
    names
        Of scenes.
    frequency
        The ball has 20 frequency^2 triangles.

    Yields
    ------
    list of Path
        A `NAME/scene.xml` each.
    """
    if not names:
        yield []
        return
    mesh = displaced_icosphere(frequency)
    ball = ply_bytes(mesh.vertices, mesh.faces)
    with TemporaryDirectory() as folder:
        paths = []
        for name in names:
            path = Path(folder) / name / "scene.xml"
            path.parent.mkdir()
            (path.parent / "ball.ply").write_bytes(ball)
            path.write_text(_scene_text(mesh.view, *LARGE[name]))
            paths.append(path)
        yield paths


def ply_bytes(
    vertices: NDArray[Any], faces: NDArray[Any], properties: Sequence[str] = "xyz"
) -> bytes:
    """Return a mesh as a binary PLY file; vertices have a column for each property."""
    rows = np.empty(len(faces), [("corners", "u1"), ("vertices", "<i4", 3)])
    rows["corners"], rows["vertices"] = 3, faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in properties]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
    text = "\n".join([*header, "end_header\n"]).encode()
    return text + vertices.astype("<f4").tobytes() + rows.tobytes()


def scene_head(
    look_at: Sequence[Sequence[float]], fov: float, depth: int, size: tuple[int, int]
) -> str:
    """Return a scene file up to its sensor: path tracing, a box filter, `$` parameters.

    `look_at` is (origin, target, up); `fov` is in degrees, along x.
    """
    eye, target, up = (", ".join(map(str, place)) for place in look_at)
    return f"""<scene version="3.0.0">
  <default name="spp" value="64"/>
  <default name="width" value="{size[0]}"/>
  <default name="height" value="{size[1]}"/>
  <integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="{fov}"/>
    <transform name="to_world">
      <lookat origin="{eye}" target="{target}" up="{up}"/>
    </transform>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
    <film type="hdrfilm">
      <integer name="width" value="$width"/>
      <integer name="height" value="$height"/>
      <string name="pixel_format" value="rgb"/>
      <rfilter type="box"/>
    </film>
  </sensor>"""


def _scene_text(view: View, depth: int, added: str) -> str:
    return f"""{scene_head(view[:3], view.fov, depth, SIZE)}
  <shape type="ply">
    <string name="filename" value="ball.ply"/>
    <boolean name="face_normals" value="true"/>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.7"/></bsdf>
  </shape>
  {added}
</scene>
"""
