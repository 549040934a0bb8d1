"""Every scene of the repository: the same geometry in our reader and in Mitsuba."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scene_file_samples import parameter, points_on

from mitsuba_ref.reference.variant import load_mitsuba
from renderer import scene_file
from renderer.scene_file.description import Mesh
from renderer.scene_file.meshes.mesh_data import surface_area

SCENES = sorted((Path(__file__).parents[3] / "scenes").glob("*/scene.xml"))
# Mitsuba has no Whitted integrator; what draws a scene is no matter here.
WHITTED, STAND_IN = 'type="whitted"', 'type="path"'


def test_there_are_scenes() -> None:
    assert len(SCENES) >= 10


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.parent.name)
def test_scene_has_the_shapes_of_mitsuba(path: Path, tmp_path: Path) -> None:
    mine = scene_file.read_file(path)
    text = path.read_text()
    if WHITTED in text:
        text = text.replace(WHITTED, STAND_IN).replace('name="cutoff"', 'name="timeout"')
        folder = f'<path value="{path.parent.resolve()}"/>'
        head, middle, tail = text.partition("<default")
        path = tmp_path / "scene.xml"
        path.write_text(head + folder + middle + tail)
    reference = load_mitsuba().load_file(str(path), optimize=False)
    theirs = reference.shapes()
    assert len(mine.shapes) + len(mine.instances) == len(theirs)
    placed = [theirs[instance.place] for instance in mine.instances]
    assert all("Instance[" in str(shape) for shape in placed)
    plain = [shape for shape in theirs if shape not in placed]
    for shape, expected in zip(mine.shapes, plain, strict=True):
        bounds, points = expected.bbox(), points_on(shape)
        size = np.max(np.array(bounds.max) - np.array(bounds.min))
        np.testing.assert_allclose(points.min(axis=0), bounds.min, atol=1e-4 * size)
        np.testing.assert_allclose(points.max(axis=0), bounds.max, atol=1e-4 * size)
        assert surface_area(shape) == pytest.approx(expected.surface_area(), rel=1e-4)
        if isinstance(shape, Mesh):
            assert len(shape.vertices) == expected.vertex_count()
        if shape.radiance is not None:
            radiance = parameter(expected.emitter(), "radiance.value")
            np.testing.assert_allclose(shape.radiance, radiance, rtol=1e-5)
    shining = sum(shape.radiance is not None for shape in mine.shapes)
    assert len(mine.emitters) + shining == len(reference.emitters())
