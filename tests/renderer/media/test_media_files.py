"""Media, volumes and phase functions as files have them: properties, and damaged files."""

from __future__ import annotations

import numpy as np
import pytest
from plugins.make_grids import grid_file
from scene_file_samples import error_of, ours
from scene_xml import props, tag

import renderer
from renderer.errors import SceneError
from renderer.scene_file.meshes.grid_file import read_channels


def medium(content="", plugin="homogeneous"):
    inside = f'<medium type="{plugin}" name="interior">{content}</medium>'
    return f'<shape type="sphere"><bsdf type="null"/>{inside}</shape>'


def read(content="", plugin="homogeneous"):
    return ours(medium(content, plugin)).shapes[0].interior


def test_the_defaults_are_those_of_mitsuba():
    found = read()
    assert (found.sigma_t.rgb, found.albedo.rgb) == ((1.0,) * 3, (0.75,) * 3)
    assert (found.scale, found.phase.plugin) == (1.0, "isotropic")


def test_colours_numbers_and_constant_volumes():
    found = read(
        tag("rgb", sigma_t="0.5 0.25 1")
        + '<volume type="constvolume" name="albedo">'
        + tag("rgb", value="0.9 2 0.1")
        + "</volume>"
        + props(scale=40.0)
    )
    assert found.sigma_t.rgb == (0.5, 0.25, 1.0)
    assert found.albedo.rgb == (0.9, 2.0, 0.1)
    assert found.scale == 40.0


def test_a_shape_without_media_is_no_boundary():
    assert not ours('<shape type="sphere"/>').has_media
    assert ours(medium()).has_media
    other = '<shape type="sphere"><medium type="homogeneous" name="fog"/></shape>'
    assert not ours(other).has_media  # neither of the two names: ignored, as in Mitsuba


PHASES = {
    "hg": (props(g=1.0), "found 1, expected a mean cosine between -1 and 1"),
    "tabphase": (tag("string", values="1 -1"), "two or more numbers of at"),
    "blendphase": (props(weight=0.5), "found 0 phase functions, expected two"),
    "rayleigh": (props(g=0.5), 'phase "rayleigh" has no property "g"'),
    "sggx": ("", 'phase "sggx" is not supported; supported phase plugins: isotropic'),
}


@pytest.mark.parametrize("plugin", PHASES)
def test_phase_functions_that_are_wrong(plugin):
    content, message = PHASES[plugin]
    text = error_of(medium(f'<phase type="{plugin}">{content}</phase>'))
    assert message in text


def test_a_weight_of_two_channels_is_refused():
    volume = {"type": "gridvolume", "grid": np.zeros((2, 2, 2, 2), np.float32)}
    blend = {"type": "blendphase", "weight": volume, "a": {"type": "hg"}}
    scene = {"type": "scene", "sensor": {"type": "perspective"}}
    inside = {"type": "homogeneous", "phase": blend | {"b": {"type": "isotropic"}}}
    with pytest.raises(SceneError, match="found 2 channels, expected 1 or 3"):
        renderer.load_dict(scene | {"shape": {"type": "sphere", "interior": inside}})


WRONG = {
    "negative": (props(sigma_t=-1.0), "found -1, expected numbers of at least 0"),
    "too large": (tag("rgb", sigma_t="2 1 1"), "a reflectance in [0, 1]"),
    "unknown": (props(sigma_s=1.0), 'has no property "sigma_s"'),
    "dense": (props(scale=1e20), "expected at least 0 and at most 1e+09"),
}


@pytest.mark.parametrize("case", WRONG)
def test_media_that_are_wrong(case):
    content, message = WRONG[case]
    assert message in error_of(medium(content))


# ------------------------------------------------------------------------------ files


VALUES = np.arange(24, dtype=np.float32).reshape(2, 3, 4, 1)


def test_a_file_is_read_as_it_is_written(tmp_path):
    (tmp_path / "a.vol").write_bytes(grid_file(VALUES, box=(-1, 0, 1, 3, 2, 5)) + b"rest")
    values, box = read_channels(tmp_path / "a.vol")
    np.testing.assert_array_equal(values, VALUES)
    np.testing.assert_array_equal(box, [[-1, 0, 1], [3, 2, 5]])


DAMAGED = {
    "another format": (b"NOT" + grid_file(VALUES)[3:], "begins with b'NOT'"),
    "another version": (grid_file(VALUES, version=2), "version 2"),
    "half floats": (grid_file(VALUES, kind=2), "has numbers of type 2"),
    "short": (grid_file(VALUES)[:-1], "there are 23 numbers"),
    "a lie": (grid_file(VALUES, nx=1 << 30, ny=1 << 30), "promises"),
    "nothing": (grid_file(VALUES, nz=0), "1 or more of each"),
    "a negative count": (grid_file(VALUES, ny=-3, nz=-2), "1 or more of each"),
    "no header": (b"VOL\3", "has 4 bytes"),
    "not a number": (grid_file(VALUES * np.nan), "has nan at x 0, y 0, z 0"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_files_are_one_error_that_names_them(case, tmp_path):
    content, message = DAMAGED[case]
    (tmp_path / "a.vol").write_bytes(content)
    with pytest.raises(SceneError, match=r"a\.vol") as refused:
        read_channels(tmp_path / "a.vol")
    assert message in str(refused.value)


def test_every_prefix_of_a_file_is_refused_or_read(tmp_path):
    whole = grid_file(VALUES)
    for length in range(len(whole)):
        (tmp_path / "a.vol").write_bytes(whole[:length])
        with pytest.raises(SceneError):
            read_channels(tmp_path / "a.vol")


def test_a_grid_with_its_box(tmp_path):
    (tmp_path / "a.vol").write_bytes(grid_file(VALUES, box=(-1, -1, -1, 3, 3, 3)))
    text = medium(
        '<volume type="gridvolume" name="sigma_t">'
        + props(filename=str(tmp_path / "a.vol"))
        + props(use_grid_bbox=True)
        + tag("string", wrap_mode="mirror")
        + "</volume>",
        "heterogeneous",
    )
    grid = ours(text, folder=tmp_path).shapes[0].interior.sigma_t
    assert grid.wrap_mode == "mirror"
    np.testing.assert_array_equal(grid.to_world @ (0, 0, 0, 1), (-1, -1, -1, 1))
    np.testing.assert_array_equal(grid.to_world @ (1, 1, 1, 1), (3, 3, 3, 1))


def test_a_grid_of_two_channels_is_refused():
    volume = {"type": "gridvolume", "grid": np.zeros((2, 2, 2, 2), np.float32)}
    scene = {
        "type": "scene",
        "sensor": {"type": "perspective"},
        "shape": {
            "type": "sphere",
            "interior": {"type": "heterogeneous", "sigma_t": volume},
        },
    }
    with pytest.raises(SceneError, match="found 2 channels, expected 1 or 3"):
        renderer.load_dict(scene)


@pytest.mark.parametrize(("least", "kept"), [(-0.001, True), (-0.1, False)])
def test_numbers_just_below_0_of_a_grid_are_0(least, kept):
    """Resampled grids have some; where they matter, the file is wrong."""
    values = np.ones((2, 2, 2, 1), np.float32)
    values[0, 1, 0] = least
    volume = {"type": "gridvolume", "grid": values}
    scene = {
        "type": "scene",
        "sensor": {"type": "perspective"},
        "shape": {
            "type": "sphere",
            "interior": {"type": "heterogeneous", "sigma_t": volume},
        },
    }
    if not kept:
        with pytest.raises(SceneError, match=r"found the number -0\.1, expected numbers"):
            renderer.load_dict(scene)
        return
    description = renderer.load_dict(scene).description
    grid = description.shapes[0].interior.sigma_t
    np.testing.assert_array_equal(grid.values, np.maximum(values, 0.0))
    assert "1 of 8 numbers are below 0, the least is -0.001" in "".join(
        description.warnings
    )
