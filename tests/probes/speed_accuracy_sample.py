"""A hand-made record of speed against accuracy: two noisy scenes, one without noise."""

from __future__ import annotations

from reports.speed_accuracy.record import (
    OURS,
    Curve,
    NoiselessPicture,
    NoiselessScene,
    NoisyScene,
    Pictures,
    SpeedAccuracy,
)

PEER = "mitsuba scalar_rgb"
ABSENT = {"mitsuba llvm_ad_rgb": "llvm_ad_rgb: no <LLVM>"}


def curve(renderer: str, sampler: str, error: float, seconds: float, method: str = "path"):
    """Return two numbers of samples of two seeds, whose error x seconds stays."""
    steps = [
        Pictures(spp, [1.1 * error / spp, 0.9 * error / spp], [seconds * spp] * 2)
        for spp in (4, 16)
    ]
    return Curve(renderer, method if renderer == OURS else "", sampler, steps)


def noisy(name: str, *curves: Curve, **changes) -> NoisyScene:
    """Return a scene."""
    return NoisyScene(name, 8, 6, "2048 samples", 1e-4, list(curves), **changes)


def noiseless() -> NoiselessScene:
    """Return a scene with two structures, two offsets and a peer."""
    pictures = [
        NoiselessPicture(OURS, "direct", structure, offset, "own", [time] * 3, error, off)
        for structure, time in (("brute", 0.4), ("wide", 0.01))
        for offset, error, off in (("tight", 1e-6, 0), ("mitsuba", 1e-5, 2))
    ]
    peer = NoiselessPicture(PEER, "", "", "", "own", [0.1] * 3, 0.0, 0)
    return NoiselessScene("teapot", 8, 6, 48, [*pictures, peer], unavailable=ABSENT)


def record(**changes) -> SpeedAccuracy:
    """Return a whole record: twice as fast as the peer in one scene, half in the other."""
    scenes = [
        noisy(
            "box",
            curve(OURS, "independent", 1.0, 0.5),
            curve(OURS, "sobol", 0.5, 0.25),
            curve(PEER, "independent", 1.0, 1.0),
            curve(PEER, "multijitter", 0.5, 0.5),
            unavailable=ABSENT,
        ),
        noisy(
            "room",
            curve(OURS, "independent", 1.0, 1.0),
            curve(OURS, "sobol", 1.0, 2.0),
            curve(OURS, "independent", 1.0, 4.0, "whitted"),
            curve(PEER, "independent", 0.5, 1.0),
            unavailable=ABSENT,
        ),
    ]
    given = {
        "whole": True,
        "spp": [4, 16],
        "seeds": 2,
        "threads": 2,
        "noisy": scenes,
        "noiseless": [noiseless()],
        "created": "2026-01-02T03:04:05Z",
        "machine": {"cpu": "Example CPU", "cores": 2},
    }
    return SpeedAccuracy(**(given | changes))
