"""The choice of one of several lights: probabilities that are those of what happens.

Numbers that fill [0, 1) evenly measure with which probability a light is chosen, without
noise; what is said of it is compared with that, with a slow float64 walk over the same
tree, and with what a path is told that finds the light by itself.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kernel_probes import Inputs
from light_probes import Bounds, importance
from numpy.typing import NDArray
from small_scenes import rgb

import renderer
from mitsuba_ref.statistics.hypothesis_tests.welch import tile_test
from renderer.kernels.jit import call, entry_kernel, pack
from renderer.kernels.records.batch import CAPACITY
from renderer.kernels.records.kernel_scene import (
    CHOOSE_BY_IMPORTANCE,
    CHOOSE_LIGHT,
    RECORD,
    WEIGH_FOUND,
)
from renderer.plugins.lights.choice import UNIFORM, LightChoice
from renderer.plugins.lights.importance import ANY_NORMAL, BOTH_SIDES, IN_FRONT, LightNodes
from renderer.rendering.planning.make_plan import make_plan
from renderer.rendering.tables.render_mode import mode_for
from renderer.scene.light_tables import light_bounds, lit_sides
from renderer.scene.materials import kind_of

SCENES = Path(__file__).parents[3] / "scenes"
NUMBERS = 1 << 14  # that fill [0, 1) evenly
UP = np.array([0.0, 0.0, 1.0])


@entry_kernel
def run_choose(lights, points, count, numbers, light):
    call(
        lights.choice[0, CHOOSE_BY_IMPORTANCE],
        lights.choice[0, RECORD],
        (points, count, numbers, light),
    )


@entry_kernel
def run_weigh(scene, work, count):
    none = np.int64(0)
    call(
        scene.lights.choice[0, WEIGH_FOUND],
        scene.lights.choice[0, RECORD],
        (
            scene.shapes,
            scene.primitives.shape,
            work.points,
            work.rays,
            work.hits,
            none,
            count,
        ),
    )


def scene_of(lights: dict[str, Any], bsdf: Any = None, **integrator: Any) -> dict[str, Any]:
    floor = {"type": "rectangle", "bsdf": bsdf or {"type": "diffuse"}}
    floor["to_world"] = np.diag([6.0, 6.0, 1.0, 1.0])
    film = {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}}
    look = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 12], [0, 0, 0, 1]])
    camera = {"type": "perspective", "fov": 50.0, "film": film, "to_world": look}
    path = {"type": "path", "max_depth": 3} | integrator
    return {"type": "scene", "integrator": path, "camera": camera, "floor": floor, **lights}


def point(position: Any, intensity: float = 1.0) -> dict[str, Any]:
    return {"type": "point", "position": list(position), "intensity": rgb(intensity)}


def lamps(count: int) -> dict[str, Any]:
    """Lights of all kinds of bounds at random places, in a fixed order."""
    rng = np.random.default_rng(count)
    made: dict[str, Any] = {}
    for k in range(count):
        place = rng.uniform((-5, -5, 0.3), (5, 5, 3))
        size = rng.uniform(0.05, 0.3)
        turn = np.eye(4)
        turn[:3, :3], turn[:3, 3] = np.linalg.qr(rng.normal(size=(3, 3)))[0], place
        shine = {"type": "area", "radiance": rgb(rng.uniform(1, 40))}
        scaled = turn @ np.diag([size, size, size, 1.0])
        made[f"light-{k}"] = (
            {"type": "sphere", "center": list(place), "radius": size, "emitter": shine},
            {"type": "rectangle", "to_world": scaled, "emitter": shine},
            {"type": "disk", "to_world": scaled, "emitter": shine},
            point(place, rng.uniform(0.1, 2)),
            {
                "type": "spot",
                "to_world": turn,
                "cutoff_angle": (40.0, 100.0, 180.0)[k // 5 % 3],
                "beam_width": (30.0, 5.0, 20.0)[k // 5 % 3],
                "intensity": rgb(rng.uniform(0.5, 5)),
            },
        )[k % 5]
    made["sun"] = {"type": "directional", "direction": [0.3, 0, -1], "irradiance": rgb(0.1)}
    made["sky"] = {"type": "constant", "radiance": rgb(0.05)}
    return made


class Probe:
    """The choice at one point after another, of a scene with one sampler.

    An even sky is one of the lights here, as environment maps are.
    """

    def __init__(self, content: dict[str, Any], sampler: str = "independent") -> None:
        self.scene = renderer.load_dict(content)
        plan = make_plan(self.scene, integrator="path", sampler=sampler)
        self.inputs = Inputs(self.scene, dataclasses.replace(plan, finds_sky=False))
        self.lights = pack(self.inputs.record.lights)
        kept = (packed.record for packed in self.inputs.tables.kept)
        (self.choice,) = (record for record in kept if isinstance(record, LightChoice))
        self.work = self.inputs.workspace()
        self.packed_work = pack(self.work)
        self.packed_points = pack(self.work.points)

    def _put(self, position: Any, normal: Any, bsdf: int = 0) -> None:
        points = self.work.points
        for row, value in (
            (points.position, position),
            (points.shading_normal, normal),
            (points.wo, normal),
        ):
            row[:] = np.asarray(value, np.float32)[:, None]
        points.bsdf[:] = bsdf

    def choose(
        self, position: Any, normal: Any = UP, numbers: int = NUMBERS
    ) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
        """Return light and probability for numbers that fill [0, 1) evenly."""
        self._put(position, normal)
        light, probability = np.zeros(numbers, np.int32), np.zeros(numbers)
        rows = self.work.numbers
        for first in range(0, numbers, CAPACITY):
            part = slice(first, first + CAPACITY)
            rows[3, :CAPACITY] = (np.arange(first, first + CAPACITY) + 0.5) / numbers
            samples = np.zeros(CAPACITY + 48, np.int32)
            run_choose(self.lights, self.packed_points, CAPACITY, rows, samples)
            light[part] = samples[:CAPACITY]
            probability[part] = rows[3, :CAPACITY]
        return light, probability

    def left_over(
        self, position: Any, normal: Any = UP
    ) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]]:
        """Return light, number and what is left of it, if the sampler chooses by pair."""
        assert self.choice.by_pair == 1
        self._put(position, normal)
        light, rest = np.zeros(NUMBERS, np.int32), np.zeros(NUMBERS)
        number = (np.arange(NUMBERS) + 0.5) / NUMBERS
        rows = self.work.numbers
        for first in range(0, NUMBERS, CAPACITY):
            part = slice(first, first + CAPACITY)
            rows[:, :CAPACITY] = np.nan  # no other number is looked at
            rows[0, :CAPACITY] = number[part]
            samples = np.zeros(CAPACITY + 48, np.int32)
            run_choose(self.lights, self.packed_points, CAPACITY, rows, samples)
            light[part], rest[part] = samples[:CAPACITY], rows[0, :CAPACITY]
        return light, number, rest

    def found(self, position: Any, prims: Any, normal: Any = UP) -> NDArray[np.float64]:
        """Return the probability that a path is told which finds primitives from there."""
        self._put(position, normal)
        rays, hits, count = self.work.rays, self.work.hits, len(prims)
        rays.pdf[:count], rays.point[:count], hits.prim[:count] = 1.0, 0, prims
        run_weigh(self.inputs.packed, self.packed_work, count)
        return 1.0 / rays.pdf[:count].astype(np.float64)


@pytest.fixture(scope="module")
def few() -> Probe:
    return Probe(scene_of(lamps(15)))


@pytest.fixture(scope="module")
def many() -> Probe:
    """More than are sampled at each point, so that there are trees of several levels."""
    return Probe(scene_of(lamps(1200)))


PLACES = [(0.1, 0.2, 0.0), (-4.0, 3.0, 0.0), (2.0, -2.0, 1.0)]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("which", ["few", "many"])
def test_lights_are_chosen_as_often_as_is_said(which, place, request):
    """The share of all numbers that choose a light is its probability.

    A light has two intervals of numbers (uniform choices and others), so that its count is
    off by less than 4; float32 numbers put a few more on the wrong side. All together the
    differences are below a thousandth: a density that forgets its uniform part differs by
    a sixteenth.
    """
    probe = request.getfixturevalue(which)
    light, probability = probe.choose(place)
    lights = probe.choice.count
    counts = np.bincount(light, minlength=lights)
    said = np.zeros(lights)
    said[light] = probability
    assert (
        np.ptp(probability[light == light[0]]) <= 1e-6 * probability[light == light[0]][0]
    )
    assert np.abs(counts - said * NUMBERS).max() < 6
    if which == "few":
        assert counts.min() > 0 and said.sum() == pytest.approx(1.0, abs=2e-6)


@pytest.fixture(scope="module", params=[15, 200])
def paired(request) -> Probe:
    """A sampler whose first number chooses, and what is left of it is used again.

    Lights in a list alone, and in trees.
    """
    return Probe(scene_of(lamps(request.param)), "sobol")


@pytest.mark.parametrize("place", [*PLACES, (0.0, 0.0, 9.0)])
def test_what_is_left_of_the_number_is_even_whatever_was_chosen(paired, place):
    """It chooses a point of the lamp: uneven, or tied to the choice, it is a bias.

    For each light, chosen by chance or by what it gives, what is left of evenly spread
    numbers fills [0, 1) evenly: no fraction of it is off by more than two of the numbers,
    and by what is lost to rounding. Above all lamps only the sky is known to give anything.
    """
    light, number, rest = paired.left_over(place)
    assert rest.min() >= 0.0 and rest.max() < 1.0
    seen = []
    for by_chance in (True, False):
        chosen = (number < UNIFORM) == by_chance
        for k in np.unique(light[chosen]):
            left = np.sort(rest[chosen & (light == k)])
            even = (np.arange(left.size) + 0.5) / left.size
            off = np.abs(left - even).max()
            assert off < 2.0 / left.size + 1e-3, (
                f"light {k}, by chance {by_chance}: {left.size} numbers, off by {off:.3f}"
            )
            seen.append(left.size)
    assert len(seen) >= paired.choice.count, "each light is chosen by chance at least"
    assert max(seen) > 100


def test_where_nothing_is_known_the_rest_is_even_too():
    """All light comes from behind: every choice is by chance."""
    lights = {f"l{k}": point((k, 0, -2)) for k in range(3)}
    light, _, rest = Probe(scene_of(lights), "sobol").left_over((0.0, 0.0, 0.0))
    for k in range(3):
        left = np.sort(rest[light == k])
        even = (np.arange(left.size) + 0.5) / left.size
        np.testing.assert_allclose(left, even, atol=2.0 / left.size)


def bounds_of_node(nodes: LightNodes, node: int, *, far: bool = False) -> Bounds:
    """Return the bounds of one light, or of all below a node, for the slow formula."""
    return Bounds(
        float(nodes.bounds[7, node]),
        nodes.bounds[:3, node].astype(float),
        float(nodes.bounds[3, node]),
        nodes.bounds[4:7, node].astype(float),
        math.atan2(nodes.bounds[9, node], nodes.bounds[8, node]),
        math.acos(nodes.bounds[10, node]),
        far,
    )


def walked(choice: LightChoice, position: Any, normal: Any) -> NDArray[np.float64]:
    """Return the probabilities of all lights in float64, by going through all nodes."""

    def given(node: int, far: bool) -> float:
        bounds = bounds_of_node(choice.nodes, node, far=far)
        return importance(bounds, np.asarray(position, float), np.asarray(normal, float))

    found = np.zeros(choice.count)

    def down(node: int, probability: float) -> None:
        count, first = int(choice.children[node]), int(choice.child[node])
        if count == 0:
            found[first] = probability
            return
        parts = np.array([given(first + k, far=False) for k in range(count)])
        parts = parts / parts.sum() if parts.sum() > 0 else np.full(count, 1 / count)
        for k in range(count):
            down(first + k, probability * parts[k])

    parts = np.array(
        [given(n, bool(f)) for n, f in zip(choice.entries, choice.at_infinity, strict=True)]
    )
    for node, part in zip(choice.entries, parts / parts.sum(), strict=True):
        down(int(node), float(part))
    return UNIFORM / choice.count + (1 - UNIFORM) * found


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("which", ["few", "many"])
def test_probabilities_are_those_of_a_slow_walk(which, place, request):
    """And these add up to one over all lights, also those that no number has chosen."""
    probe = request.getfixturevalue(which)
    light, probability = probe.choose(place, numbers=4 * CAPACITY)
    slow = walked(probe.choice, place, UP)
    assert slow.sum() == pytest.approx(1.0, abs=1e-6)
    assert slow.min() >= UNIFORM / probe.choice.count
    np.testing.assert_allclose(probability, slow[light], rtol=3e-3)
    assert np.median(np.abs(probability / slow[light] - 1)) < 1e-4


def test_a_node_gives_at_least_something_where_a_light_below_does(many):
    """A tree that forgets a part of its lights would never go down to them.

    Bounds of all lights by themselves, and of the nodes above, at random places.
    """
    choice, nodes = many.choice, many.choice.nodes
    rng = np.random.default_rng(8)
    places = rng.uniform((-6, -6, 0), (6, 6, 3), (60, 3))
    normals = rng.normal(size=(60, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]

    def below(node: int) -> list[int]:
        first, count = int(choice.child[node]), int(choice.children[node])
        if count == 0:
            return [node]
        return [leaf for child in range(first, first + count) for leaf in below(child)]

    lights = light_bounds(many.scene)
    inner = np.flatnonzero(choice.children)
    assert len(inner) > 64
    for node in rng.choice(inner, 40, replace=False):
        leaves = below(int(node))
        of_leaves = [bounds_of_node(nodes, leaf) for leaf in leaves]
        strength = sum(bounds.strength for bounds in of_leaves)
        assert nodes.bounds[7, node] == pytest.approx(strength, rel=1e-4)
        mine = bounds_of_node(nodes, int(node))
        for leaf in leaves:
            light = lights[choice.child[leaf]]
            beyond = np.linalg.norm(light.center - mine.center) + light.radius
            assert beyond < mine.radius + 1e-3, f"a light {beyond} from node {node}"
        for place, normal in zip(places, normals, strict=True):
            given = max(importance(bounds, place, normal) for bounds in of_leaves)
            if given > 1e-6 * strength:
                found = importance(mine, place, normal)
                assert found > 0.0, f"node {node} of {len(leaves)} lights at {place}"


@pytest.mark.parametrize("which", ["few", "many"])
def test_a_light_that_is_found_has_the_same_probability(which, request):
    """The probability of an area light or the sky is that with which it is chosen."""
    probe = request.getfixturevalue(which)
    light, probability = probe.choose(PLACES[0])
    prims = np.arange(len(probe.scene.shape))
    of_prim = probe.scene.materials.light[probe.scene.shape]
    told = dict(zip(of_prim, probe.found(PLACES[0], prims), strict=True))
    told[probe.choice.environment] = probe.found(PLACES[0], [-1])[0]
    assert told.pop(-1) == 1.0  # the floor
    chosen = {k: p for k, p in zip(light, probability, strict=True) if k in told}
    assert len(chosen) > 5 and probe.choice.environment in chosen
    for k, p in chosen.items():
        assert told[k] == pytest.approx(p, rel=1e-6)


def test_two_points_as_on_paper():
    """I / r^2 cos, with a sixteenth of uniform choices; below the horizon nothing.

    A point counts as a ball of 1e-5 of the lights' box.
    """
    lights = {
        "a": point((0, 0, 2), 3.0),
        "b": point((3, 0, 4), 2.0),
        "c": point((0, 0, -1)),
    }
    probe = Probe(scene_of(lights))
    light, probability = probe.choose((0.0, 0.0, 0.0))
    given = np.array([3 / 4, 2 / 25 * 0.8, 0.0])
    expected = UNIFORM / 3 + (1 - UNIFORM) * given / given.sum()
    np.testing.assert_allclose(probability, expected[light], rtol=2e-5)
    assert set(light) == {0, 1, 2}


@pytest.mark.parametrize(
    ("bsdf", "sides"),
    [
        ({"type": "diffuse"}, IN_FRONT),
        ({"type": "twosided", "bsdf": {"type": "diffuse"}}, IN_FRONT),
        ({"type": "roughdielectric"}, BOTH_SIDES),
        ({"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}}, BOTH_SIDES),
    ],
)
def test_where_lights_are_looked_for(bsdf, sides):
    lights = {"a": point((0, 0, 1)), "b": point((0, 0, -1))}
    content = scene_of(lights, bsdf)
    scene = renderer.load_dict(content)
    # a half-open surface without a sky takes lights as Mitsuba does, unless told otherwise
    plan = make_plan(scene, integrator="path", light_choice="importance")
    kept = (packed.record for packed in Inputs(scene, plan).tables.kept)
    (choice,) = (record for record in kept if isinstance(record, LightChoice))
    assert choice.sides[0] == sides


def test_where_normals_are_turned_lights_are_looked_for_everywhere():
    """A bump that leans over the horizon sees what a plane would not."""
    materials = renderer.load_file(SCENES / "bumps" / "scene.xml").materials
    sides = {kind_of(bsdf).name: lit_sides(kind_of(bsdf)) for bsdf in materials.bsdfs}
    assert {name for name, side in sides.items() if side == ANY_NORMAL} == {
        name for name in sides if "map" in name
    }
    assert sides["diffuse"] == IN_FRONT and ANY_NORMAL in sides.values()


@pytest.mark.parametrize(
    "change",
    [
        {"lights": 1},
        {"integrator": "direct"},
        {"integrator": "whitted"},
        {"light_choice": "uniform"},
        {"sampler": "mitsuba"},
    ],
    ids=["one light", "direct", "whitted", "uniform", "replay"],
)
def test_who_does_not_choose_by_importance(change):
    """These compile and run what they did: the sampler's choice, or none."""
    change = {"integrator": "path", **change}
    lights = {f"l{k}": point((k, 0, 2)) for k in range(change.pop("lights", 3))}
    scene = renderer.load_dict(scene_of(lights))
    plan = make_plan(scene, **change)
    record = Inputs(scene, plan, way=mode_for(plan, None)).record
    assert record.lights.choice.size == 0 and record.sampler[0, CHOOSE_LIGHT] != 0
    chosen = make_plan(scene, integrator="path")
    if len(lights) > 1:
        record = Inputs(scene, chosen).record
        assert len(record.lights.choice) == 1 and record.sampler[0, CHOOSE_LIGHT] == 0
        assert record.lights.choice[0, WEIGH_FOUND] == 0  # points are never found


@pytest.mark.parametrize("sampler", ["independent", "sobol"])
def test_both_choices_give_the_same_picture(sampler):
    """Emitters of all kinds: tile means of 12 renders each, Welch's test.

    The false alarm rate is 1e-4 for one other seed. A BSDF's side that forgets the choice
    makes some tiles 10 % too bright or too dark; a bias of 2 % of all is seen.
    """
    path = renderer.load_dict(scene_of(lamps(15)))
    pictures = {
        choice: np.stack(
            [
                renderer.render(
                    path,
                    spp=64,
                    seed=seed,
                    integrator="path",
                    sampler=sampler,
                    light_choice=choice,
                ).pixels.astype(np.float64)
                for seed in range(12)
            ]
        )
        for choice in ("uniform", "importance")
    }
    test = tile_test(pictures["importance"], pictures["uniform"])
    assert test.p_value > 1e-4
    spread = {name: p.std(axis=0).mean() for name, p in pictures.items()}
    assert spread["importance"] < 0.9 * spread["uniform"]


def test_names_of_choices_are_checked():
    scene = renderer.load_dict(scene_of({"a": point((0, 0, 1)), "b": point((1, 0, 1))}))
    with pytest.raises(renderer.SceneError, match="'power' is unknown; there are: importa"):
        make_plan(scene, light_choice="power")
    with pytest.raises(renderer.SceneError, match="a replay takes Mitsuba's, 'uniform'"):
        make_plan(scene, sampler="mitsuba", light_choice="importance")
    assert dataclasses.replace(make_plan(scene), every_light=True).by_importance is False
