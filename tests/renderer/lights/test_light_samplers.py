"""Chi-square tests of the lights: directions drawn against the density stated for them.

Setup: a light, a point that sees it, 2^20 directions of `sample_light`. Each is put back on
the light in float64; the histogram there is compared with the integrals of
`pdf_shape` (density per solid angle) over the cells. Samples that carry no light, on
the far side of closed shapes, are a cell of their own.

Each comparison has a false alarm rate of 1e-5 and asserts that it finds a density tilted by
3 % from one end of the light to the other with a power of 99 % (`chi_square.py`), and
where there is one piece an excess of 25 % in one of 256 cells. Where but a share s of the
samples carries light, these are 3 and 25 % / sqrt(s). All 29 comparisons of a right
renderer fail with a chance of 2.9e-4; the seeds are fixed.
"""

from __future__ import annotations

import numpy as np
import pytest
from chi_square import assert_follows, cell_masses, histogram
from kernel_probes import float32, unit
from light_charts import (
    all_around_chart,
    cone_chart,
    flat_chart,
    mantle_share,
    tube_chart,
)
from light_probes import LightProbe

N = 1 << 20
FINDS = 0.03
EXCESS = 0.25
RADIANCE = (2.0, 1.0, 0.5)


def placed(number, linear=None, shift=(0, 0, 0)):
    matrix = np.eye(4)
    matrix[:3, :3] = np.eye(3) if linear is None else linear
    matrix[:3, 3] = shift
    matrix[0, 3] += number
    return matrix


TURNED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]])
SHAPES = {
    "rectangle": {"type": "rectangle", "to_world": placed(0)},
    "sheared": {
        "type": "rectangle",
        "to_world": placed(20, TURNED @ np.diag([2, 0.5, 1])),
    },
    "disk": {"type": "disk", "to_world": placed(40)},
    "ellipse": {"type": "disk", "to_world": placed(60, TURNED @ np.diag([1.5, 0.5, 1]))},
    "sphere": {"type": "sphere", "to_world": placed(80)},
    "lamp": {"type": "sphere", "to_world": placed(100), "flip_normals": True},
    "cylinder": {"type": "cylinder", "to_world": placed(120, np.diag([0.5, 0.5, 2]))},
    "cube": {"type": "cube", "to_world": placed(140, np.diag([1, 0.5, 0.25]))},
}
CENTER = {name: shape["to_world"][:3, 3] for name, shape in SHAPES.items()}

# six vertices around one in the middle; areas of the triangles from 0.01 to 6
ROOF = np.array(
    [[0, 0, 0.1], [3, 0, 0], [3.1, 0.01, 0], [1, 4, 0.05], [-0.2, 3, 0], [-1, -0.5, 0]]
)
ROOF_FACES = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5), (0, 5, 1)]
ROOF_CENTER = np.array([160.0, 0, 0])


def roof_file(folder):
    lines = [f"v {x} {y} {z}" for x, y, z in ROOF + ROOF_CENTER]
    lines += ["f {} {} {}".format(*np.add(face, 1)) for face in ROOF_FACES]
    path = folder / "roof.obj"
    path.write_text("\n".join(lines))
    return str(path)


@pytest.fixture(scope="module")
def roof(tmp_path_factory):
    path = roof_file(tmp_path_factory.mktemp("roof"))
    return {"type": "obj", "filename": path, "face_normals": True}


@pytest.fixture(scope="module")
def lights(roof):
    constant = {"type": "constant", "radiance": {"type": "rgb", "value": list(RADIANCE)}}
    others = {k: {"type": k} for k in ("point", "spot", "directional")}
    return LightProbe({**SHAPES, "roof": roof}, {**others, "constant": constant}, RADIANCE)


@pytest.fixture(scope="module")
def replayed_lights(roof):
    """Meshes alone: of the other shapes the replay of Mitsuba draws points in our way."""
    shapes = {"cube": SHAPES["cube"], "roof": roof}
    return LightProbe(shapes, {}, RADIANCE, replay=True)


# ------------------------------------------------------------------------- comparison


def grid(pieces):
    cells = 16 if pieces == 1 else 8
    return np.linspace(0, 1, cells + 1)


def piece_of(charts, wi):
    """Number, a and b of the piece that each direction meets.

    Rounding may have put a sample across an edge: the piece is the one that it misses by
    least, and at most by 1e-3 of its size.
    """
    found = [chart.find(wi) for chart in charts]
    beyond = np.array([np.maximum(np.abs(a - 0.5), np.abs(b - 0.5)) for a, b in found])
    which = beyond.argmin(axis=0)
    rows = np.arange(len(wi))
    a, b = (np.array([f[k] for f in found])[which, rows] for k in (0, 1))
    a[beyond[which, rows] > 0.501] = np.nan
    return which, np.clip(a, 0, 1), np.clip(b, 0, 1)


def compare(lights, name, position, charts, *, mass=1.0, within=1e-5):
    """Draw N directions, count them in all charts, and compare with the density.

    `charts` are pairs of a chart and the primitive that is met there; `mass` is the share
    of the samples that carry light, and with fewer of them the test is less sharp.
    """
    edges = grid(len(charts))

    def density(chart, prim):
        def stated(a, b):
            seen = chart.look(a, b)
            pdf = lights.density(name, position, prim, seen.distance, seen.cosine)
            return pdf * seen.solid_angle

        return stated

    masses = np.array([cell_masses(density(*c), edges, edges) for c in charts])
    rng = np.random.default_rng(position.astype(np.float32).view(np.uint32))
    drawn = lights.sample(name, position, rng.random((3, N), np.float32))
    wi = unit(drawn.wi[drawn.radiance[:, 1] > 0])
    which, a, b = piece_of([chart for chart, _ in charts], wi)
    counts = np.array(
        [histogram(a[which == k], b[which == k], edges, edges) for k in range(len(charts))]
    )
    blunt = 1 / np.sqrt(mass)
    outcome = assert_follows(
        counts, masses, N, finds=FINDS * blunt, mass=mass, within=within
    )
    assert len(charts) > 1 or outcome.excess() < EXCESS * blunt


def float32_point(center, where):
    return float32(np.add(center, where)).astype(float)


def columns(surfaces, prim):
    """Corner and edges of a flat primitive."""
    k = prim - surfaces.first
    return [
        a[:, k].astype(float) for a in (surfaces.corner, surfaces.edge1, surfaces.edge2)
    ]


# ------------------------------------------------------------------------- flat lights


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("rectangle", (0.5, -0.3, 1)),
        ("rectangle", (3, 0.2, 0.05)),  # at a grazing angle
        ("rectangle", (30, 50, 80)),
        ("sheared", TURNED[:, 2] + (0.3, 0.2, 0.1)),
        ("disk", (1, 0, 0.7)),
        ("disk", (0, 0, 0.1)),
        ("ellipse", TURNED[:, 2] - (0.3, 0.1, 0.2)),
    ],
)
def test_flat_lights(lights, name, where):
    """By area: the density per solid angle is r^2 / (A cos)."""
    position = float32_point(CENTER[name], where)
    kind = SHAPES[name]["type"]
    (prim,) = lights.prims(name)
    surfaces = lights.surfaces[kind + "s"]
    chart = flat_chart(kind, position, *columns(surfaces, prim))
    compare(lights, name, position, [(chart, prim)])


# ----------------------------------------------------------------------------- meshes


def mesh_charts(lights, name, position):
    """The triangles that face the point, with the share of their area."""
    charts, areas = [], []
    for prim in lights.prims(name):
        corner, e1, e2 = columns(lights.surfaces["triangles"], prim)
        normal = np.cross(e1, e2)
        if (position - corner) @ normal > 0:
            charts.append((flat_chart("triangle", position, corner, e1, e2), prim))
            areas.append(np.linalg.norm(normal) / 2)
    return charts, sum(areas)


@pytest.mark.parametrize("where", [(1.5, 0.4, 1), (-3, 2, -1)])
def test_cube_light(lights, where):
    """Triangles by area, points in them evenly; the faces turned away carry nothing."""
    position = float32_point(CENTER["cube"], where)
    charts, area = mesh_charts(lights, "cube", position)
    assert len(charts) == 2 * np.sum(np.abs(where) > [1, 0.5, 0.25])
    compare(lights, "cube", position, charts, mass=area / 14 * 2)


@pytest.mark.parametrize("where", [(1, 1, 1.5), (0.2, 0.3, 20)])
def test_mesh_light_of_uneven_triangles(lights, where):
    """Areas from 0.01 to 6: the alias table's choice and the point in the triangle."""
    position = float32_point(ROOF_CENTER, where)
    charts, _ = mesh_charts(lights, "roof", position)
    assert len(charts) == len(ROOF_FACES)
    compare(lights, "roof", position, charts)


@pytest.mark.parametrize("name", ["cube", "roof"])
def test_mesh_lights_in_a_replay(replayed_lights, name):
    """As Mitsuba chooses: by search in cumulated areas; the point takes what is left."""
    center = ROOF_CENTER if name == "roof" else CENTER["cube"]
    position = float32_point(center, (1.5, 1.2, 2))
    charts, area = mesh_charts(replayed_lights, name, position)
    mass = 1.0 if name == "roof" else area / 14 * 2
    compare(replayed_lights, name, position, charts, mass=mass)


# ---------------------------------------------------------------------- round lights


@pytest.mark.parametrize("away", [1000.0, 100.0, 3.0, 1.2, 1.01, 1.0001, 1 + 1e-6])
def test_sphere_light_from_outside(lights, away):
    """Evenly in the cone; far away, and so near that the cone is half of all directions.

    There the cosine of the cone is the root of a difference of float32 numbers, and the
    density is off by up to 4e-5 of itself.
    """
    position = float32_point(CENTER["sphere"], away * unit([1.0, 2, -2]))
    (prim,) = lights.prims("sphere")
    chart = cone_chart(position, CENTER["sphere"], 1.0)
    within = 1e-5 if away > 1.00001 else 4e-5
    compare(lights, "sphere", position, [(chart, prim)], within=within)


@pytest.mark.parametrize(
    "where", [(0, 0, 0), (0.5, 0, 0), (0.2, -0.6, 0.6), (0.3, 0, 0.94)]
)
def test_sphere_light_from_inside(lights, where):
    """By area, over all directions: r^2 / (A cos), near the wall with a narrow peak."""
    position = float32_point(CENTER["lamp"], where)
    (prim,) = lights.prims("lamp")
    chart = all_around_chart(position, CENTER["lamp"], 1.0)
    compare(lights, "lamp", position, [(chart, prim)])


@pytest.mark.parametrize("where", [(1, 0.5, 0.7), (-2, 3, 5), (0.52, 0, 1)])
def test_cylinder_light(lights, where):
    """By area; the far half of the wall is seen from inside, where it does not shine."""
    position = float32_point(CENTER["cylinder"], where)
    (prim,) = lights.prims("cylinder")
    chart = tube_chart(position, CENTER["cylinder"], 0.5, 2.0)
    share = mantle_share(position, CENTER["cylinder"], 0.5)
    compare(lights, "cylinder", position, [(chart, prim)], mass=share)


def test_constant_environment(lights):
    """1 / (4 pi) in all directions, as each sample states it."""
    rng = np.random.default_rng(99)
    drawn = lights.sample("constant", [1.0, 2, 3], rng.random((3, N), np.float32))
    np.testing.assert_allclose(drawn.pdf, 1 / (4 * np.pi), rtol=2e-7)
    edges = grid(1)
    chart = all_around_chart(np.zeros(3), np.zeros(3), 1.0)
    masses = cell_masses(
        lambda a, b: drawn.pdf[0] * chart.look(a, b).solid_angle, edges, edges
    )
    a, b = chart.find(unit(drawn.wi))
    assert_follows(histogram(a, b, edges, edges), masses, N, finds=FINDS)


# ----------------------------------------------------------------------------- choice


def test_the_choice_of_a_light_is_uniform(lights):
    """Among 13 lights; one that is preferred by 3 % is found."""
    number = np.random.default_rng(7).random(N, np.float32)
    count = len(lights.names)
    chosen = np.bincount(lights.choices(number), minlength=count)
    outcome = assert_follows(chosen, np.full(count, 1 / count), N, finds=0.015)
    assert outcome.excess() < 0.03
