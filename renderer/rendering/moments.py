"""Second moments beside a picture: what the integrator `moment` shows of single samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.integrators import first_hit
from renderer.rendering.aovs import CHANNELS_OF, asked_aovs
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene

# XYZ of linear sRGB, with the digits that Mitsuba has
XYZ_FROM_SRGB = np.array(
    [
        [0.412453, 0.357580, 0.180423],
        [0.212671, 0.715160, 0.072169],
        [0.019334, 0.119193, 0.950227],
    ],
    np.float32,
)


def squared_sums(plan: Plan, channels: int) -> NDArray[np.float32] | None:
    """Return which sums of `channels` have their squares taken, (m, channels).

    X, Y and Z of the colours, and where an `aov` shows these too, R, G and B; of AOVs each
    channel. None: the plan wants no moments.
    """
    if plan.moments is None:
        return None
    if plan.method == "aov":
        return np.eye(channels, dtype=np.float32)
    sums = np.zeros((6 if plan.moments.colors else 3, channels), np.float32)
    if plan.method == "depth":  # its picture is the depth, in all three colours
        sums[:3, first_hit.DEPTH] = XYZ_FROM_SRGB.sum(axis=1)
        sums[3:, first_hit.DEPTH] = 1.0
    else:
        sums[:3, :3] = XYZ_FROM_SRGB
        sums[3:, :3] = np.eye(3)[: len(sums) - 3]
    return sums


def with_moments(
    scene: Scene,
    plan: Plan,
    pixels: NDArray[np.float32],
    aovs: dict[str, Any],
    kinds: dict[str, str],
    squares: NDArray[np.float32],
) -> tuple[dict[str, Any], dict[str, str]]:
    """Return the AOVs and their kinds under the names of `moment`, their moments behind.

    Parameters
    ----------
    scene, plan
        What was rendered; the plan wants moments.
    pixels, aovs, kinds
        As they would be without them.
    squares
        (H, W, m) the means of the squares of `squared_sums`.
    """
    moments = plan.moments
    assert moments is not None
    name, first, second = moments.name, moments.within, f"{moments.within}m2_"
    if plan.method == "aov":
        given = {f"{first}{name}.{key}": values for key, values in aovs.items()}
        their_kinds = {f"{first}{name}.{key}": kind for key, kind in kinds.items()}
        for key, kind in asked_aovs(scene):
            given[f"{second}{name}.{key}"] = squares[..., CHANNELS_OF[kind]]
            their_kinds[f"{second}{name}.{key}"] = kind
        return _contiguous(given), their_kinds
    shown = {f"{first}{name}": (pixels @ XYZ_FROM_SRGB.T, "xyz")}
    shown[f"{second}{name}"] = (squares[..., :3], "xyz")
    if moments.colors:
        inner = f"{name}.{moments.colors}"
        shown[f"{first}{inner}"] = (pixels, "color")
        shown[f"{second}{inner}"] = (squares[..., 3:], "color")
    kinds_shown = {key: kind for key, (_, kind) in shown.items()}
    return _contiguous({key: values for key, (values, _) in shown.items()}), kinds_shown


def _contiguous(aovs: dict[str, Any]) -> dict[str, Any]:
    return {key: np.ascontiguousarray(values) for key, values in aovs.items()}
