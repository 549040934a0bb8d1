"""Where a film puts things: slanted edges known in closed form, shifts and flips."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import small_scenes
from noise_samples import SHAPE, SPREAD, fireflies, gaussian, pictures, scene
from scipy import optimize
from small_scenes import diffuse, rectangle, sensor

from mitsuba_ref.statistics.hypothesis_tests.welch import critical_t
from mitsuba_ref.statistics.power import noncentrality
from mitsuba_ref.statistics.registration import (
    NEGLIGIBLE,
    find_flip,
    picture_shift,
)

SIZE = 24
FOV, DISTANCE = 40.0, 4.0
WIDTH = 2.0 * DISTANCE * math.tan(math.radians(FOV / 2.0))  # of what the film sees
ANGLES = (0.3, 1.2)  # of the edge's normal: two edges tell x and y


LARGEST = 2.0  # [pixels], of a shift that an edge is searched for


@dataclass(frozen=True)
class Edge:
    """Where a picture has the edge of a half-plane."""

    shift: float  # [pixels] along the normal, towards the dark side
    residual: float  # RMS of what is left: noise, or another picture altogether


def half_plane_coverage(
    width: int, height: int, normal: tuple[float, float], offset: float
) -> np.ndarray:
    """Return the share of each pixel in which normal . p < offset, (H, W).

    The distance of a uniform point of the unit square from its centre, along the normal
    (a, b), is a U + b V with U, V uniform in [-1/2, 1/2]; its distribution function is the
    second difference of a ramp squared, a trapezoid integrated.

    Parameters
    ----------
    width, height
        Pixels.
    normal
        Of length 1, x to the right and y *down*; both components away from 0.
    offset
        Pixels, with p = (0, 0) in the upper left corner of the film.
    """
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return _distribution(offset - normal[0] * x - normal[1] * y, normal)


def _distribution(distance: np.ndarray, normal: tuple[float, float]) -> np.ndarray:
    a, b = abs(normal[0]), abs(normal[1])

    def ramp(h: np.ndarray) -> np.ndarray:
        return np.maximum(h, 0.0) ** 2

    outer, inner = (a + b) / 2.0, (a - b) / 2.0
    total = ramp(distance + outer) - ramp(distance + inner)
    total += ramp(distance - outer) - ramp(distance - inner)
    # Two differences of squares, each up to 1e6: rounding leaves 1e-10 on either side.
    return np.asarray(np.clip(total / (2.0 * a * b), 0.0, 1.0))


def edge_shift(picture: np.ndarray, normal: tuple[float, float], offset: float) -> Edge:
    """Fit the half-plane's edge to a picture (H, W) of it, 1 lit and 0 dark.

    The parameters are those of `half_plane_coverage` and say where the edge should be.
    """
    height, width = picture.shape
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    distance = offset - normal[0] * x - normal[1] * y

    def squares(shift: float) -> float:
        return float(np.mean((picture - _distribution(distance + shift, normal)) ** 2))

    # The sum has one minimum for the right picture; the grid guards against wrong ones.
    grid = np.linspace(-LARGEST, LARGEST, 81)
    start = grid[int(np.argmin([squares(shift) for shift in grid]))]
    step = grid[1] - grid[0]
    found = optimize.minimize_scalar(
        squares, bounds=(start - step, start + step), method="bounded"
    )
    return Edge(shift=float(found.x), residual=float(np.sqrt(found.fun)))


def normal_of(angle: float) -> tuple[float, float]:
    return math.cos(angle), math.sin(angle)


def middle(angle: float) -> float:
    """Offset of an edge through the middle of the film."""
    return sum(normal_of(angle)) * SIZE / 2.0


def test_coverage_of_a_pixel_by_hand():
    """Normal (3, 4) / 5: through the centre a half; through the nearest corner nothing.

    The line 3 x + 4 y = 3 cuts off a triangle with legs 1 and 3/4: an area of 3/8.
    """
    normal = (0.6, 0.8)
    assert half_plane_coverage(1, 1, normal, 0.7)[0, 0] == pytest.approx(0.5)
    assert half_plane_coverage(1, 1, normal, 0.0)[0, 0] == pytest.approx(0.0, abs=1e-12)
    assert half_plane_coverage(1, 1, normal, 1.4)[0, 0] == pytest.approx(1.0)
    assert half_plane_coverage(1, 1, normal, 0.6)[0, 0] == pytest.approx(3.0 / 8.0)


@pytest.mark.parametrize("angle", [0.3, 1.2, 2.0, -2.5])
def test_coverage_is_what_points_of_a_pixel_say(angle):
    """400 x 400 points in each of 36 pixels; a slanted line errs by 1 / 400 at most."""
    normal, offset = normal_of(angle), 3.0 * sum(normal_of(angle)) + 0.3
    fine = (np.arange(6 * 400) + 0.5) / 400.0
    x, y = np.meshgrid(fine, fine)
    inside = normal[0] * x + normal[1] * y < offset
    counted = inside.reshape(6, 400, 6, 400).mean(axis=(1, 3))
    np.testing.assert_allclose(
        half_plane_coverage(6, 6, normal, offset), counted, atol=1.0 / 400.0
    )


@pytest.mark.parametrize("shift", [-1.3, -0.5, 0.0, 0.01, 0.5])
def test_a_known_shift_of_an_edge_is_found(shift):
    normal = normal_of(0.3)
    picture = half_plane_coverage(SIZE, SIZE, normal, middle(0.3) + shift)
    found = edge_shift(picture, normal, middle(0.3))
    assert found.shift == pytest.approx(shift, abs=1e-4)
    assert found.residual < 1e-4


def half_plane(angle: float, shift: float) -> dict[str, Any]:
    """A lit half-plane whose edge is `shift` pixels past the middle of the film.

    Film y runs down and world y up, so the normal (a, b) on the film is (a, -b) there.
    """
    n = np.array([math.cos(angle), -math.sin(angle), 0.0])
    center = n * (shift * WIDTH / SIZE - 10.0)
    along = np.array([-n[1], n[0], 0.0])
    plane = rectangle(center, 10.0 * n, 10.0 * along, diffuse(0.0), shine=1.0)
    camera = sensor(
        (0, 0, DISTANCE),
        (0, 0, 0),
        up=(0, 1, 0),
        fov=FOV,
        size=(SIZE, SIZE),
        spp=64,
        jitter=True,
    )
    return small_scenes.scene(camera, "path", plane, max_depth=1)


def by_us(content: dict[str, Any]) -> np.ndarray:
    return small_scenes.pixels(content, seed=1)[..., 0]


def by_mitsuba(content: dict[str, Any]) -> np.ndarray:
    from mitsuba_ref.reference.variant import load_mitsuba

    mi = load_mitsuba()

    def converted(value: Any, key: str = "") -> Any:
        if isinstance(value, dict):
            return {name: converted(item, name) for name, item in value.items()}
        return mi.ScalarTransform4f(value) if key == "to_world" else value

    return np.array(mi.render(mi.load_dict(converted(content)), seed=1))[..., 0]


@pytest.mark.parametrize("render", [by_us, by_mitsuba])
def test_both_films_put_a_slanted_edge_where_it_is(render):
    """Two edges: the film is right to 0.02 pixels in x and y, and 0.5 is seen as 0.5.

    64 stratified samples leave a noise of about 0.03 in each of 24 pixels on an edge, 0.006
    pixels of shift. A film that is off by half a pixel, or mirrored, is far out.
    """
    normals = np.array([normal_of(angle) for angle in ANGLES])
    for moved in (0.0, 0.5):
        shifts = []
        for angle, normal in zip(ANGLES, normals, strict=True):
            picture = render(half_plane(angle, moved)).astype(float)
            edge = edge_shift(picture, tuple(normal), middle(angle))
            assert edge.residual < 0.03
            assert edge.shift == pytest.approx(moved, abs=0.02)
            shifts.append(edge.shift)
            for flipped in (picture[:, ::-1], picture[::-1]):
                assert edge_shift(flipped, tuple(normal), middle(angle)).residual > 0.1
        x, y = np.linalg.solve(normals, shifts)
        expected = np.linalg.solve(normals, [moved, moved])
        assert np.hypot(x - expected[0], y - expected[1]) < 0.03


def moved_scene(right: float, below: float) -> np.ndarray:
    """The scene of `noise_samples`, seen by a film that is shifted."""
    y, x = np.meshgrid(
        np.arange(SHAPE[0]) - below, np.arange(SHAPE[1]) - right, indexing="ij"
    )
    grey = 1.0 + 0.5 * np.sin(0.4 * y + 0.1 * x) + 0.3 * np.cos(0.6 * x)
    return grey[..., None] * np.array([1.0, 0.9, 0.8])


@pytest.mark.parametrize(("right", "below"), [(0.5, 0.0), (0.0, -0.5), (-0.3, 0.7)])
def test_a_shift_is_found_in_noisy_pictures(right, below):
    """To four standard errors and a tenth of the shift."""
    rng = np.random.default_rng(1)
    found = picture_shift(pictures(rng, truth=moved_scene(right, below)), pictures(rng))
    errors = 4.0 * np.array(found.standard_errors)
    assert abs(found.x - right) < errors[0] + 0.1 * abs(right)
    assert abs(found.y - below) < errors[1] + 0.1 * abs(below)
    assert found.p_value < 1e-6


def test_standard_errors_of_a_shift_are_its_scatter():
    """Over 60 pairs: within a third; 60 values tell a scatter to a tenth."""
    rng = np.random.default_rng(2)
    found = [picture_shift(pictures(rng), pictures(rng)) for _ in range(60)]
    scatter = np.std([[shift.x, shift.y] for shift in found], axis=0)
    stated = np.mean([shift.standard_errors for shift in found], axis=0)
    np.testing.assert_allclose(scatter, stated, rtol=1.0 / 3.0)


def test_a_wrong_factor_is_no_shift():
    """Ten per cent brighter: no claim about the film's place."""
    rng = np.random.default_rng(3)
    found = picture_shift(pictures(rng, truth=1.1 * scene()), pictures(rng))
    assert found.length < NEGLIGIBLE or found.p_value > 1e-3


def test_the_stated_shift_is_seen():
    """99 of 100: at least 36 of 40 (0.99 stays below with probability 3e-5)."""
    rng = np.random.default_rng(4)
    first = picture_shift(pictures(rng), pictures(rng))
    size = noncentrality(critical_t(1e-3, 2, first.degrees), first.degrees)
    size *= max(first.standard_errors)
    truth = moved_scene(size, 0.0)
    found = [picture_shift(pictures(rng, truth=truth), pictures(rng)) for _ in range(40)]
    assert sum(shift.p_value <= 1e-3 for shift in found) >= 36


@pytest.mark.parametrize(
    ("name", "rows", "columns"),
    [("left and right", 1, -1), ("top and bottom", -1, 1), ("both ways", -1, -1)],
)
def test_a_flip_is_named(name, rows, columns):
    rng = np.random.default_rng(5)
    a, b = pictures(rng), pictures(rng)
    assert find_flip(a[:, ::rows, ::columns], b, 1e-3) == name
    assert find_flip(a, b, 1e-3) is None


@pytest.mark.parametrize("noise", [gaussian, fireflies])
def test_a_symmetric_scene_is_not_called_flipped(noise):
    """Nothing tells it from its mirror image: 40 pairs, 1e-3 each."""
    rng = np.random.default_rng(6)
    for _ in range(40):
        a = 1.0 + SPREAD * np.stack([noise(rng) for _ in range(16)])
        assert find_flip(a[:8], a[8:], 1e-3) is None
