"""Sensors: the same camera rays as Mitsuba, and its films, filters and samplers."""

from __future__ import annotations

import re
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, mitsuba_refuses, ours, theirs
from scene_xml import element, props, to_world

from renderer.plugins.sensors.registry import kind_of_sensor
from renderer.scene_file.description import Film, PerspectiveCamera, Sampler
from renderer.scene_file.objects.films import round_sample_count
from renderer.simple.camera import camera_ray

SENSOR = '<sensor type="perspective">\n{}</sensor>'
FILM = '<film type="hdrfilm">\n{}</film>'
WIDE = FILM.format(props(width=60, height=40))
TALL = FILM.format(props(width=30, height=50))
CROPPED = FILM.format(
    props(
        width=60,
        height=40,
        crop_offset_x=10,
        crop_offset_y=4,
        crop_width=20,
        crop_height=30,
    )
)
LOOKAT = to_world('<lookat origin="1 2 3" target="0 0.5 -1" up="0 1 0.2"/>')


def camera(content: str) -> PerspectiveCamera:
    return ours("", sensor=SENSOR.format(content)).camera


def reference(content: str) -> Any:
    return theirs("", sensor=SENSOR.format(content)).sensors()[0]


def ray(camera: PerspectiveCamera, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Return origin and direction through a point of the crop window, in [0, 1]^2.

    Only from what the record says: looks along +z, +x points left, +y up.
    """
    film = camera.film
    across = (film.crop_offset_x + x * film.crop_width) / film.width
    down = (film.crop_offset_y + y * film.crop_height) / film.height
    half_width = np.tan(np.radians(camera.fov_x) / 2)
    half_height = half_width * film.height / film.width
    local = np.array(
        [
            (1 - 2 * (across + camera.principal_point_offset_x)) * half_width,
            (1 - 2 * (down + camera.principal_point_offset_y)) * half_height,
            1.0,
        ]
    )
    local /= np.linalg.norm(local)
    position = camera.to_world[:3, 3] + camera.to_world[:3, :3] @ local * (
        camera.near_clip / local[2]
    )
    return position, camera.to_world[:3, :3] @ local


AXES = [
    f'<float name="fov" value="45"/><string name="fov_axis" value="{axis}"/>{film}'
    for axis in ("x", "y", "diagonal", "smaller", "larger", "Y")
    for film in (WIDE, TALL, CROPPED)
]
CAMERAS = [
    "",
    *AXES,
    WIDE + props(focal_length="35mm"),
    TALL + props(focal_length="80"),
    CROPPED + LOOKAT + props(fov=60.0),
    CROPPED
    + LOOKAT
    + props(principal_point_offset_x=0.2)
    + props(principal_point_offset_y=-0.1),
    WIDE + props(near_clip=0.5, far_clip=7.0) + LOOKAT,
    WIDE + '<transform name="to_world"><scale x="-1"/></transform>',
    WIDE + props(fov=30, focus_distance=3.0),
]


@pytest.mark.parametrize("content", CAMERAS, ids=range(len(CAMERAS)))
def test_rays_are_those_of_mitsuba(content: str) -> None:
    """Origin on the near plane, direction, and length up to the far plane."""
    mine, sensor = camera(content), reference(content)
    for x, y in ((0.5, 0.5), (0.0, 0.0), (1.0, 0.25), (0.1, 0.9)):
        expected, _ = sensor.sample_ray(0.0, 0.5, [x, y], [0.5, 0.5])
        origin, direction = ray(mine, x, y)
        np.testing.assert_allclose(direction, expected.d, atol=2e-6)
        np.testing.assert_allclose(origin, expected.o, atol=1e-5)
        forward = direction @ mine.to_world[:3, 2]
        length = (mine.far_clip - mine.near_clip) / forward
        assert length == pytest.approx(expected.maxt, rel=1e-4)


LENS = props(aperture_radius=0.3, focus_distance=4.0)
PLANES = props(near_clip=0.5, far_clip=7.0)
SCALED = to_world(
    '<scale x="-2" y="3" z="1.5"/><lookat origin="1 2 3" target="0 0.5 -1" up="0 1 0.2"/>'
)
SENSORS = [
    ("perspective", CROPPED + LOOKAT + PLANES),
    ("thinlens", CROPPED + LOOKAT + PLANES + LENS),
    ("thinlens", TALL + props(aperture_radius=0.01)),
    ("thinlens", WIDE + LENS + props(fov=50.0, fov_axis="larger")),
    ("orthographic", ""),
    ("orthographic", TALL + LOOKAT + PLANES),
    ("orthographic", CROPPED + SCALED + PLANES),
]


@pytest.mark.parametrize(("plugin", "content"), SENSORS, ids=range(len(SENSORS)))
def test_all_sensors_have_the_rays_of_mitsuba(plugin: str, content: str) -> None:
    """In double precision, all over the crop window and the lens."""
    text = f'<sensor type="{plugin}">\n{content}</sensor>'
    mine, sensor = ours("", sensor=text).camera, theirs("", sensor=text).sensors()[0]
    film = mine.film
    lens = kind_of_sensor(mine).has_aperture
    assert lens == sensor.needs_aperture_sample()
    for x, y, u, v in np.random.default_rng(1).random((20, 4)):
        expected, _ = sensor.sample_ray(0.0, 0.5, [x, y], [u, v])
        across = film.crop_offset_x + x * film.crop_width
        down = film.crop_offset_y + y * film.crop_height
        p, d, near, far = camera_ray(mine, across, down, (u, v))
        np.testing.assert_allclose(d, expected.d, atol=2e-6)
        np.testing.assert_allclose(p + near * d, expected.o, atol=1e-5)
        assert far - near == pytest.approx(expected.maxt, rel=1e-4)


@pytest.mark.parametrize(
    ("plugin", "content", "message"),
    [
        ("thinlens", "", 'property "aperture_radius": found nothing, expected the radius'),
        ("thinlens", props(aperture_radius=-1.0), "found -1, expected at"),
        (
            "thinlens",
            LENS + '<transform name="to_world"><scale value="2"/></transform>',
            "a transform that scales or shears, expected a rotation and translation",
        ),
        (
            "thinlens",
            props(aperture_radius=1.0, focus_distance=0.0),
            "found 0, expected above 0",
        ),
        (
            "thinlens",
            LENS + props(principal_point_offset_x=0.1),
            'has no property "principal_point_offset_x"',
        ),
        ("orthographic", props(fov=9.0), 'has no property "fov"'),
        (
            "orthographic",
            to_world('<scale value="1e15"/>'),
            "what makes the picture reach farther than 1e+18",
        ),
        ("radiancemeter", "", "sensor plugins: perspective, thinlens, orthographic"),
    ],
)
def test_bad_sensors_are_refused(plugin: str, content: str, message: str) -> None:
    assert message in error_of("", sensor=f'<sensor type="{plugin}">\n{content}</sensor>')


def test_a_lens_of_radius_0_becomes_a_small_one() -> None:
    """As in Mitsuba, with a warning."""
    text = '<sensor type="thinlens"><float name="aperture_radius" value="0"/></sensor>'
    scene = ours("", sensor=text)
    expected = mi.traverse(theirs("", sensor=text).sensors()[0])["aperture_radius"]
    assert scene.camera.aperture_radius == expected
    assert "0 is taken as 5.96046e-08" in scene.warnings[0]


def test_default_film_sampler_and_filter_are_those_of_mitsuba() -> None:
    mine, sensor = camera(""), reference("")
    assert mine.film == Film()
    assert mine.sampler == Sampler()
    assert [mine.film.width, mine.film.height] == list(sensor.film().size())
    assert mine.sampler.sample_count == sensor.sampler().sample_count()
    assert "IndependentSampler" in str(sensor.sampler())
    assert "GaussianFilter" in str(sensor.film().rfilter())
    assert mine.film.rfilter.radius == sensor.film().rfilter().radius()


@pytest.mark.parametrize("content", [WIDE, TALL, CROPPED])
def test_film_and_crop_window_are_those_of_mitsuba(content: str) -> None:
    film, expected = camera(content).film, reference(content).film()
    assert [film.width, film.height] == list(expected.size())
    assert [film.crop_width, film.crop_height] == list(expected.crop_size())
    assert [film.crop_offset_x, film.crop_offset_y] == list(expected.crop_offset())


def filter_value(rfilter: Any, x: float) -> float:
    """Evaluate the filter that a record describes, by its textbook formula."""
    x = abs(x)
    if x >= rfilter.radius and rfilter.name != "box":
        return 0.0
    match rfilter.name:
        case "box":
            return 1.0 if x <= rfilter.radius else 0.0
        case "tent":
            return 1.0 - x / rfilter.radius
        case "gaussian":
            scale = -0.5 / rfilter.stddev**2
            return np.exp(scale * x * x) - np.exp(scale * rfilter.radius**2)
        case "lanczos":
            return np.sinc(x) * np.sinc(x / rfilter.radius)
    b, c = (rfilter.b, rfilter.c) if rfilter.name == "mitchell" else (0.0, 0.5)
    if x < 1:
        cubic = (12 - 9 * b - 6 * c) * x**3 + (-18 + 12 * b + 6 * c) * x**2 + 6 - 2 * b
    else:
        cubic = (-b - 6 * c) * x**3 + (6 * b + 30 * c) * x**2
        cubic += (-12 * b - 48 * c) * x + 8 * b + 24 * c
    return cubic / 6


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("box", ""),
        ("tent", ""),
        ("tent", props(radius=1.5)),
        ("gaussian", ""),
        ("gaussian", props(stddev=0.8)),
        ("mitchell", ""),
        ("mitchell", props(B=1.0, C=0.0)),
        ("catmullrom", ""),
        ("lanczos", ""),
        ("lanczos", props(lobes=2)),
    ],
)
def test_filters_have_the_numbers_of_mitsuba(name: str, content: str) -> None:
    text = FILM.format(f'<rfilter type="{name}">{content}</rfilter>')
    mine, expected = camera(text).film.rfilter, reference(text).film().rfilter()
    assert mine.name == name
    assert mine.radius == pytest.approx(expected.radius())
    for x in (0.0, 0.3, 0.45, 0.8, 1.2, 1.9, 2.5):
        assert filter_value(mine, x) == pytest.approx(expected.eval(x), abs=2e-3)


@pytest.mark.parametrize(
    "name", ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"]
)
def test_samplers_round_their_counts_as_mitsuba_does(name: str) -> None:
    for count in (
        1,
        2,
        3,
        4,
        5,
        7,
        10,
        16,
        17,
        30,
        50,
        60,
        64,
        65,
        100,
        122,
        256,
        500,
        1000,
    ):
        expected = mi.load_dict({"type": name, "sample_count": count}).sample_count()
        assert round_sample_count(name, count) == expected
    text = f'<sampler type="{name}"><integer name="sample_count" value="10"/></sampler>'
    scene = ours("", sensor=SENSOR.format(text))
    assert scene.camera.sampler.name == name
    assert scene.camera.sampler.sample_count == reference(text).sampler().sample_count()
    assert len(scene.warnings) == (name != "independent")


def test_sampler_seed_and_jitter() -> None:
    text = element("sampler", "stratified", seed=7, jitter=False)
    assert camera(text).sampler == Sampler("stratified", 4, 7, False)
    reference(text)


def test_film_properties_that_say_how_mitsuba_stores_are_taken() -> None:
    text = FILM.format(
        props(
            file_format="OpenEXR",
            pixel_format="rgba",
            component_format="float32",
            sample_border=False,
            compensate=True,
            banner=False,
        )
    )
    assert camera(text).film == Film()
    reference(text)


@pytest.mark.parametrize("pixels", ["luminance", "luminance_alpha", "xyz", "XYZA"])
def test_other_pixels_than_rgb_are_warned_about(pixels: str) -> None:
    text = FILM.format(f'<string name="pixel_format" value="{pixels}"/>')
    described = ours("", sensor=SENSOR.format(text))
    assert described.camera.film == Film()
    assert f"names {pixels.lower()} pixels; pictures are rgb" in described.warnings[0]
    reference(text)


@pytest.mark.parametrize(
    "rfilter",
    [
        '<rfilter type="box"/>',
        '<rfilter type="tent"><float name="radius" value="1.7"/></rfilter>',
        '<rfilter type="gaussian"><float name="stddev" value="0.4"/></rfilter>',
        '<rfilter type="mitchell"/>',
        '<rfilter type="lanczos"><integer name="lobes" value="4"/></rfilter>',
    ],
)
def test_samples_beyond_the_film_reach_as_far_as_in_mitsuba(rfilter: str) -> None:
    border = props(sample_border=True)
    film = camera(FILM.format(border + rfilter)).film
    theirs = reference(FILM.format(border + rfilter)).film()
    assert film.border == theirs.rfilter().border_size()
    assert camera(FILM.format(rfilter)).film.border == 0


# -------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (props(fov=180.0), "found 180 degrees, expected a field of view betw"),
        (props(fov=0.0), "found 0 degrees"),
        (props(fov=-20.0), "found -20 degrees"),
        (props(fov_axis="y"), 'a value without a fov, expected a "fov" with'),
        (
            props(fov=9.0, fov_axis="z"),
            'found "z", expected one of x, y, diagonal, smaller, larger',
        ),
        (
            props(focal_length="35mm", fov=9.0),
            'found a value together with "fov", expected one of the two',
        ),
        (props(focal_length="0mm"), "found 0 mm, expected a length above 0"),
        (props(focal_length="x"), 'is "x"; expected a finite number'),
        (props(focal_length=35.0), "a value of type float, expected string"),
        (props(near_clip=0.0), "found 0, expected above 0"),
        (
            props(near_clip=5.0, far_clip=4.0),
            "found near_clip 5 and far_clip 4, expected near_clip < far_clip",
        ),
        (props(aperture_radius=1.0), 'has no property "aperture_radius"; supp'),
        (
            to_world('<scale value="2"/>'),
            "a transform that scales or shears, expected a rotation and translation",
        ),
        (WIDE + WIDE, "a second <film> in sensor"),
        ('<rfilter type="box"/>', "has no <rfilter>; supported: <film>, <sampler>"),
        ('<film type="specfilm"/>', "supported film plugins: hdrfilm"),
        ('<sampler type="sobol"/>', "supported sampler plugins: independent, stratified"),
        (FILM.format(props(width=-1)), "found -1, expected at least 1"),
        (FILM.format(props(width=10.0)), "a value of type float, expected inte"),
        (
            FILM.format(props(crop_offset_x=10)),
            "found a crop window from 10 to 778, expected one inside of the film's "
            "width, 0 to 7",
        ),
        (
            FILM.format(props(crop_height=577)),
            'property "crop_height": found a crop window from 0 to 577',
        ),
        (FILM.format(props(pixel_format="foo")), "one of rgb, rgba"),
        (FILM.format(props(file_format="png")), "one of openexr, exr, pfm, rg"),
        (
            FILM.format('<rfilter type="sinc"/>'),
            "supported rfilter plugins: box, tent, gauss",
        ),
        (
            FILM.format('<rfilter type="box"><float name="radius" value="1"/></rfilter>'),
            'rfilter "box" has no property "radius"; supported: none',
        ),
        (
            FILM.format(element("rfilter", "lanczos", lobes=2.0)),
            "a value of type float, expected integer",
        ),
        (
            element("sampler", "independent", jitter=True),
            'has no property "jitter"; supported: sample_count, seed',
        ),
    ],
)
def test_sensors_that_are_wrong(content: str, message: str) -> None:
    found = error_of("", sensor=SENSOR.format(content))
    assert re.match(r"<string>:[3-5]: ", found)
    assert message in found
    assert mitsuba_refuses("", sensor=SENSOR.format(content))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (FILM.format(props(width=0)), "found 0, expected at least 1"),
        (FILM.format(props(crop_width=0)), "found 0, expected at least 1"),
        (
            FILM.format(props(width=100000, height=100000)),
            "has 100000 x 100000 pixels; expected at most 4294967296",
        ),
        (
            FILM.format(element("rfilter", "gaussian", stddev=0.0)),
            "found 0, expected above 0 and at most 16",
        ),
        (element("sampler", "independent", sample_count=0), "found 0, expected at least 1"),
    ],
)
def test_sensors_that_only_we_refuse(content: str, message: str) -> None:
    """Mitsuba makes empty pictures, NaN, or another picture than we would."""
    assert message in error_of("", sensor=SENSOR.format(content))
