"""docs/mitsuba-faults.md: its scenes still show their faults in the installed Mitsuba."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scene_file_samples import mi

from mitsuba_ref.generate.files import grid_bytes

PAGE = Path(__file__).parents[3] / "docs" / "mitsuba-faults.md"
FILE = re.compile(r"```\w+ (\S+\.\w+)\n(.*?)```", re.DOTALL)  # a block with a name
SCENE = re.compile(r"```xml\n(.*?)```", re.DOTALL)
MEAN = re.compile(r"Mean of the picture: ([-\w.]+); right: ([-\d.]+)")
MOST = 12  # lines of a scene
GRIDS = {"plane.vol": (2, 2, 5), "cube.vol": (3, 3, 3)}  # nx, ny, nz

ENTRIES = dict(re.findall(r"^### (.*?)\n(.*?)(?=^##|\Z)", PAGE.read_text(), re.M | re.S))
MEASURED = {
    name: (scene[1], float(mean[1]), float(mean[2]))
    for name, text in ENTRIES.items()
    if (scene := SCENE.search(text)) and (mean := MEAN.search(text))
}


def test_each_entry_has_a_small_scene():
    """And most have a number."""
    for name, text in ENTRIES.items():
        scene = SCENE.search(text)
        assert scene, name
        assert scene[1].count("\n") <= MOST, name
    assert len(MEASURED) >= len(ENTRIES) - 10


@pytest.mark.parametrize("name", MEASURED)
def test_mitsuba_still_shows_it(name, tmp_path):
    """If the mean is the right one, Mitsuba has mended it: the entry is to be removed."""
    scene, shown, right = MEASURED[name]
    for file, content in FILE.findall(PAGE.read_text()):
        (tmp_path / file).write_text(content)
    for file, (nx, ny, nz) in GRIDS.items():
        z = np.linspace(0.0, 1.0, nz)[:, None, None, None]
        (tmp_path / file).write_bytes(grid_bytes(np.tile(0.5 - z, (1, ny, nx, 1))))
    path = tmp_path / "scene.xml"
    path.write_text(scene)
    mean = np.mean(mi.render(mi.load_file(str(path)), seed=1))
    assert mean == pytest.approx(shown, rel=0.03, abs=1e-6, nan_ok=True)
    assert mean != pytest.approx(right, rel=0.03, abs=1e-3)
