"""`moment`: the picture of its inner integrator, and second moments as more channels.

The channels are Mitsuba's: the colours' X, Y and Z, and under `m2_` the mean of the
squares of single samples. The variance of a pixel follows from both.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.integrators.kind import IntegratorKind, Shown
from renderer.scene_file.description import Integrator, Moments
from renderer.scene_file.objects.sensors import read_integrator
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element

# XYZ from linear sRGB, with Mitsuba's digits
XYZ_FROM_SRGB = np.array(
    [
        [0.412453, 0.357580, 0.180423],
        [0.212671, 0.715160, 0.072169],
        [0.019334, 0.119193, 0.950227],
    ],
    np.float32,
)


class Moment(NamedTuple):
    """The plugin `moment`. Reading it sets the field `moments` of its inner integrator."""

    def read(self, properties: Properties) -> Integrator:
        """Return the inner integrator, with moments added to its channels.

        Raises
        ------
        SceneError
            If there is not exactly one inner integrator, or it has moments itself.
        """
        element = properties.element
        children = properties.children("integrator")
        if len(children) != 1:
            found = f"{element} holds {len(children)} integrators"
            raise SceneError(f"{element.location}: {found}; expected one")
        key, child = children[0]
        inner = read_integrator(child, properties.reading)
        nested = inner.nested
        if inner.moments is not None or (nested is not None and nested.moments is not None):
            raise SceneError(
                f"{child.location}: {element} around another one is not supported; "
                "expected path, direct, whitted, depth, or aov around one of them"
            )
        name = element.name_of(key)
        if nested is not None:
            below = next(
                key
                for key, property_ in child.properties.items()
                if isinstance(property_.value, Element)
            )
            moments = Moments(name, colors=child.name_of(below))
            nested = dataclasses.replace(nested, moments=moments)
        properties.boolean("hide_emitters", False)  # the inner integrator's is used
        return dataclasses.replace(inner, moments=Moments(name), nested=nested)


MOMENT = Moment()


def squared_sums(kind: IntegratorKind, requested: Integrator) -> NDArray[np.float32]:
    """Return the linear combinations of channels whose squares are summed.

    These are all AOV channels, or X, Y and Z of the colours; also R, G and B if an `aov`
    is in between. The coefficients are found by calling `show` on each channel alone,
    since its result is linear in the channels.

    Returns
    -------
    ndarray of shape (m, channels)
    """
    single = np.eye(kind.channels, dtype=np.float32)[:, None, :]
    shown = [values for _, values, _ in _parts(kind.show(single, requested), requested)]
    return np.ascontiguousarray(np.concatenate(shown, axis=2)[:, 0, :].T)


def show_moments(kind: IntegratorKind, film: NDArray[Any], requested: Integrator) -> Shown:
    """Return what the integrator shows, then the moments. `film` ends with the squares."""
    shown = kind.show(film[..., : kind.channels], requested)
    moments = requested.moments
    assert moments is not None
    first, second = moments.within, f"{moments.within}m2_"
    aovs: dict[str, NDArray[Any]] = {}
    kinds: dict[str, str] = {}
    squares: dict[str, NDArray[Any]] = {}
    start = kind.channels
    for name, values, meaning in _parts(shown, requested):
        end = start + values.shape[2]
        aovs[first + name], kinds[first + name] = values, meaning
        squares[second + name], kinds[second + name] = film[..., start:end], meaning
        start = end
    both = {name: np.ascontiguousarray(values) for name, values in (aovs | squares).items()}
    # as in Mitsuba, the picture around AOVs is black
    pixels = np.zeros_like(shown.pixels) if shown.aovs else shown.pixels
    return Shown(pixels, both, kinds, shown.notes)


def _parts(shown: Shown, requested: Integrator) -> Iterator[tuple[str, NDArray[Any], str]]:
    """Yield name, values (H, W, C) and kind of each output that has second moments."""
    moments = requested.moments
    assert moments is not None
    for name, values in shown.aovs.items():
        yield f"{moments.name}.{name}", values, shown.aov_kinds[name]
    if not shown.aovs:
        yield moments.name, shown.pixels @ XYZ_FROM_SRGB.T, "xyz"
        if moments.colors:
            yield f"{moments.name}.{moments.colors}", shown.pixels, "color"
