"""Spot lights in a replay: Mitsuba's falloff to the bit near the rim, no defect hidden."""

import numpy as np
import pytest
from environment_maps import LAMP
from light_probes import LightProbe
from small_scenes import look_at

import renderer.replay.replay_mode
from renderer.replay.light_rounding import rounded_spots

mi = pytest.importorskip("mitsuba")
N = 1000
WHITE = (1.0, 1.0, 1.0)
DOWN = look_at((0, 0, 2), (0, 0, 0), (0, 1, 0))
TILTED = look_at((0.3, 0.7, 2), (0.1, -0.2, 0), (0, 1, 0.2))
SPOTS = {
    "a few degrees": (DOWN, {"cutoff_angle": 10.0}),
    "half a degree": (TILTED, {"cutoff_angle": 0.5}),
    "wide": (TILTED, {"cutoff_angle": 70.0}),
    "more than a half space": (TILTED, {"cutoff_angle": 120.0, "beam_width": 80.0}),
    "fading from the axis": (TILTED, {"cutoff_angle": 20.0, "beam_width": 0.0}),
    "scaled": (TILTED @ np.diag([3.0, 3.0, 3.0, 1.0]), {"cutoff_angle": 10.0}),
    "a thin rim": (TILTED, {"cutoff_angle": 20.0, "beam_width": 19.9}),
}


def points(to_world, cutoff):
    """Return points (n, 3) at angles up to a little more than the cutoff."""
    rng = np.random.default_rng(4)
    angle = np.radians(min(1.05 * cutoff, 175.0)) * np.sqrt(rng.random(N))
    around, away = 2 * np.pi * rng.random(N), rng.uniform(1, 3, N)
    local = np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around), np.cos(angle)
    axes = to_world[:3, :3] / np.linalg.norm(to_world[:3, 0])
    return np.float32(to_world[:3, 3] + (away * local).T @ axes.T)


def pair(to_world, settings):
    """Ours and Mitsuba's; a file's matrix is inverted in double precision."""
    values = " ".join(map(repr, to_world.ravel().tolist()))
    angles = "".join(f'<float name="{k}" value="{v!r}"/>' for k, v in settings.items())
    theirs = mi.load_string(
        f"""<scene version="3.0.0"><emitter type="spot">{angles}
        <rgb name="intensity" value="1"/>
        <transform name="to_world"><matrix value="{values}"/></transform>
        </emitter></scene>"""
    ).emitters()[0]
    spot = {"type": "spot", "to_world": to_world, **settings}
    spot["intensity"] = {"type": "rgb", "value": [1.0, 1.0, 1.0]}
    return LightProbe(LAMP, {"spot": spot}, WHITE, replay=True), theirs


def asked(theirs, position):
    at, light = mi.Interaction3f(), []
    for p in position.tolist():
        at.p = p
        light.append(theirs.sample_direction(at, mi.Point2f(0.5))[1][0])
    return np.array(light)


@pytest.mark.parametrize("case", SPOTS)
def test_light_is_mitsubas(case):
    """Where an angle's last bit is 1e-3 of what is left of the intensity, too.

    What is left to differ are the width's reciprocal and 1 / r^2: each rounds by 1e-7.
    """
    to_world, settings = SPOTS[case]
    ours, theirs = pair(to_world, settings)
    position = points(to_world, settings["cutoff_angle"])
    found = ours.sample("spot", position, np.zeros((3, N), np.float32)).radiance[:, 0]
    expected = asked(theirs, position)
    assert 0.05 < (expected == 0.0).mean() < 0.5
    lit = expected > 0.0
    off = np.abs(found / np.where(lit, expected, 1.0) - 1.0)[lit]
    assert np.quantile(off, 0.999) < 2e-6
    assert (found[~lit] == 0.0).mean() > 0.99


@pytest.mark.parametrize(("times", "stays"), [(1.001, True), (1.0 + 1e-6, False)])
def test_a_falloff_of_ours_stays(monkeypatch, times, stays):
    """A cutoff that is 0.1 % too wide is no rounding; 1e-6 of it is."""

    def wider(own, lights):
        rounded = rounded_spots(own, lights)
        return rounded._replace(own=own._replace(cutoff=own.cutoff * np.float32(times)))

    to_world, settings = SPOTS["a few degrees"]
    position, numbers = points(to_world, 10.0), np.zeros((3, N), np.float32)
    right = pair(to_world, settings)[0].sample("spot", position, numbers).radiance[:, 0]
    monkeypatch.setattr(renderer.replay.replay_mode, "rounded_spots", wider)
    wrong = pair(to_world, settings)[0].sample("spot", position, numbers).radiance[:, 0]
    falloff = right * ((position - to_world[:3, 3]) ** 2).sum(axis=1)
    fading = (falloff > 0.01) & (falloff < 0.99)
    off = np.abs(wrong / np.where(fading, right, 1.0) - 1.0)[fading]
    assert (off > 1e-3).all() if stays else (off < 3e-3).all()
    assert stays or (off == 0.0).mean() > 0.5
