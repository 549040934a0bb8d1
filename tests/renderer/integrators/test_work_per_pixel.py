"""`integrator="work"`: counts of the accelerators per pixel, and their colours.

The truth is the tally of the same camera rays, taken by a kernel of the test, and brute
force, which tests every primitive for every ray whatever the picture shows.
"""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from agreement import one_of_each_family
from kernel_probes import Inputs, workspace
from scene_file_samples import scene_text
from small_scenes import diffuse, floor, point_light, rectangle, scene, sensor, sphere

import renderer
from renderer.command.cli import main
from renderer.command.plan_text import plan_text
from renderer.errors import SceneError
from renderer.integrators.stages.camera_rays import camera_rays
from renderer.integrators.stages.film import (
    CONTROL_POINTS,
    heat_colours,
)
from renderer.integrators.stages.intersect import intersect
from renderer.kernels.jit import entry_kernel, pack
from renderer.kernels.records.batch import (
    BOXES,
    NAMES,
    NODES,
    PRIMITIVES,
    SAVED,
    Tile,
    make_tally,
)
from renderer.rendering.planning.make_plan import make_plan

WIDTH, HEIGHT = 40, 20  # two tiles, the second of them narrow
AOVS = tuple(f"work.{name.replace(' ', '_')}" for name in NAMES)
CUBE = {"type": "cube", "bsdf": diffuse(0.5)}


def view(*parts, **camera):
    settings = {"up": (0, 0, 1), "fov": 60, "size": (WIDTH, HEIGHT)} | camera
    return renderer.load_dict(
        scene(sensor((1, -6, 2), (0, 0, 0), **settings), "path", *parts)
    )


def many_squares():
    """More than brute force takes by itself, in one kind."""
    places = np.random.default_rng(1).uniform(-2, 2, (90, 3))
    return [rectangle(p, (0.2, 0, 0), (0, 0.1, 0.2), diffuse(0.5)) for p in places]


@entry_kernel
def run_tally(scene, tile, work, tally):
    count = camera_rays(scene, tile, 0, work, np.int64(0))
    intersect(scene.groups, work.rays, work.hits, np.int64(0), count, True, tally)
    return count


def counts(image) -> np.ndarray:
    return np.concatenate([image.aovs[name] for name in AOVS], axis=2)


# ---------------------------------------------------------------------------- counts


def test_brute_force_tests_every_primitive_for_every_pixel():
    """Two kinds of primitives, rays that hit and rays that miss; four samples a pixel."""
    loaded = view(floor(half=1.0), sphere(diffuse(0.5)), point_light((0, 0, 5)), spp=4)
    image = renderer.render(loaded, integrator="work", accel="brute")
    assert (image.aovs["work.primitive_tests"] == 2).all()
    for row in (NODES, BOXES, SAVED):
        assert not image.aovs[AOVS[row]].any()
    assert image.integrator == "work"


@one_of_each_family
def test_every_structure_counts(name):
    """Rays that hit the cube tested a primitive at least; no counter is left unset."""
    image = renderer.render(view(CUBE), integrator="work", accel=name)
    found = counts(image)
    assert (found >= 0).all()
    assert found[HEIGHT // 2, WIDTH // 2, PRIMITIVES] > 0
    assert image.pixels.max() > 0.5


def test_pixels_are_the_tally_of_the_same_rays():
    """Pixel by pixel what the kernel counted for its ray, so the sums agree too."""
    loaded = view(*many_squares())
    image = renderer.render(loaded, integrator="work", accel="bvh", seed=3, threads=2)
    inputs = Inputs(loaded, make_plan(loaded, integrator="work"), "bvh", 3)
    truth = np.full((HEIGHT, WIDTH, len(NAMES)), -1)
    for x, width in ((0, 32), (32, 8)):
        work, tally = workspace(1024), make_tally(1024)
        tile = Tile(x, 0, width, HEIGHT, WIDTH)
        found = run_tally(inputs.packed, tile, pack(work), tally)
        slot = work.rays.slot[:found]
        column = (slot & 3) | (((slot >> 4) & 7) << 2)
        row = ((slot >> 2) & 3) | ((slot >> 7) << 2)
        truth[row, x + column] = tally[:, :found].T
    np.testing.assert_array_equal(counts(image), truth)
    assert 0 < truth[..., PRIMITIVES].mean() < 90
    assert len(np.unique(truth[..., BOXES])) > 5


def test_counts_are_means_over_the_samples_of_their_own_pixel():
    """The file's filter would smear them: 4 samples give quarters, whatever it is."""
    loaded = view(*many_squares(), spp=4, jitter=True, rfilter="gaussian")
    found = counts(renderer.render(loaded, integrator="work", accel="bvh"))
    quarters = 4.0 * found
    assert np.array_equal(quarters, np.round(quarters))
    assert (found != np.round(found)).any()


def test_an_empty_scene_costs_nothing():
    image = renderer.render(view(), integrator="work")
    assert not counts(image).any()
    assert not image.pixels.any()


# --------------------------------------------------------------------------- colours


def test_colours_are_those_of_the_total_and_the_scale_is_said():
    loaded = view(*many_squares())
    image = renderer.render(loaded, integrator="work", accel="bvh")
    tests = image.aovs["work.box_tests"] + image.aovs["work.primitive_tests"]
    brightest = float(image.metadata["brightest"].split()[0])
    assert brightest == tests.max()
    np.testing.assert_array_equal(image.pixels, heat_colours(tests[..., 0], brightest))
    page = " ".join(plan_text(loaded, integrator="work").split())
    assert "from 0 (black) to the pixel with the most" in page


def test_equal_steps_of_work_are_equal_steps_of_colour():
    """In Oklab: lightness grows evenly, and the colour's steps differ by 6 % at most."""
    steps = np.diff(CONTROL_POINTS, axis=0)
    assert steps[:, 0] == pytest.approx(0.24)
    length = np.linalg.norm(steps, axis=1)
    assert length.max() < 1.07 * length.min()


def test_colours_beyond_the_scale():
    assert not heat_colours([[0.0, 3.0]], 0.0).any()
    assert np.array_equal(heat_colours(7.0, 5.0), heat_colours(5.0, 5.0))
    assert heat_colours(np.zeros((4, 2)), 1.0).shape == (4, 2, 3)


# ----------------------------------------------------------------------------- files


def test_an_exr_holds_the_counters_by_name(tmp_path, capsys):
    """The command prints which number the brightest colour is; the header keeps it."""
    scene_file, out = tmp_path / "cube.xml", tmp_path / "work.exr"
    scene_file.write_text(
        '<scene version="3.0.0"><sensor type="perspective"><film type="hdrfilm">'
        '<integer name="width" value="8"/><integer name="height" value="4"/></film>'
        '<transform name="to_world"><lookat origin="1,6,2" target="0,0,0" up="0,0,1"/>'
        '</transform></sensor><shape type="cube"/></scene>'
    )
    command = [str(scene_file), "-o", str(out), "--integrator", "work", "--spp", "1"]
    assert main(command) == 0
    assert "brightest colour: 12 box and primitive tests per ray" in capsys.readouterr().out
    with OpenEXR.File(str(out), separate_channels=True) as file:
        channels, header = file.channels(), file.header()
        assert header["brightest"] == "12 box and primitive tests per ray"
        assert {f"{name}.Y" for name in AOVS} | {"R", "G", "B"} == set(channels)
        assert (channels["work.primitive_tests.Y"].pixels == 12).all()


def test_an_unknown_integrator_lists_this_one_too():
    with pytest.raises(SceneError, match=r"depth, aov, work; did you mean work\?$"):
        renderer.render(view(CUBE), integrator="wrok")


def test_a_scene_file_does_not_ask_for_it():
    """A file says what a picture shows; what it costs is the program's option."""
    text = scene_text('<integrator type="work"/>')
    with pytest.raises(SceneError) as refused:
        renderer.render(renderer.load_string(text))
    message = str(refused.value)
    assert (
        "supported integrator plugins: direct, whitted, path, volpath, depth, aov"
        in message
    )
