"""Arbitrary output variables (AOVs) of the first hit, around another integrator."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.integrators.kind import Case, Decision, IntegratorKind, Shown, as_picture
from renderer.integrators.stages import first_hit
from renderer.scene_file.description import AOV_KINDS, Integrator
from renderer.scene_file.numbers import quoted, split_list
from renderer.scene_file.objects.sensors import read_integrator
from renderer.scene_file.properties import Properties

_CHANNELS = {
    "depth": slice(first_hit.DEPTH, first_hit.DEPTH + 1),
    "position": slice(first_hit.POSITION, first_hit.POSITION + 3),
    "uv": slice(first_hit.UV, first_hit.UV + 2),
    "geo_normal": slice(first_hit.GEO_NORMAL, first_hit.GEO_NORMAL + 3),
    "sh_normal": slice(first_hit.SH_NORMAL, first_hit.SH_NORMAL + 3),
    "prim_index": slice(first_hit.PRIM_INDEX, first_hit.PRIM_INDEX + 1),
    "shape_index": slice(first_hit.SHAPE_INDEX, first_hit.SHAPE_INDEX + 1),
    "albedo": slice(first_hit.ALBEDO, first_hit.ALBEDO + 3),
}


def _read(properties: Properties) -> Integrator:
    if not properties.has("aovs"):
        properties.fail("aovs", "nothing", 'a list like "dd:depth, nn:sh_normal"')
    aovs: list[tuple[str, str]] = []
    for entry in split_list(properties.string("aovs", "")):
        name, _, kind = entry.partition(":")
        if not name or kind not in AOV_KINDS:
            properties.fail(
                "aovs", quoted(entry), "name:kind with a kind of " + ", ".join(AOV_KINDS)
            )
        if name in (known for known, _ in aovs):
            properties.fail("aovs", f"the name {quoted(name)} twice", "different names")
        aovs.append((name, kind))
    if not aovs:
        properties.fail("aovs", "an empty list", 'a list like "dd:depth, nn:sh_normal"')
    nested = _nested(properties)
    # AOVs include emitters; the inner integrator has a `hide_emitters` of its own
    properties.boolean("hide_emitters", False)
    return Integrator(
        "aov",
        aovs=tuple(aovs),
        nested=nested,
        refusal="" if nested is None else nested.refusal,
    )


def _nested(properties: Properties) -> Integrator | None:
    children = properties.children("integrator")
    child = properties.child("integrator")
    if child is None:
        return None
    nested = read_integrator(child, properties.reading)
    if nested.name == "aov":
        raise SceneError(
            f"{child.location}: an aov integrator inside of another one is not supported; "
            "write all aovs in one list"
        )
    if nested.moments is not None:
        within = f"{properties.element.name_of(children[0][0])}."
        moments = dataclasses.replace(nested.moments, within=within)
        nested = dataclasses.replace(nested, moments=moments)
    return nested


def _decide(case: Case, say: Callable[[str, str], None]) -> Decision:
    say("method", "aov: the first hit alone; no light, no BSDF is sampled")
    if case.requested.nested is None and case.requested.moments is None:
        (name, kind), *_ = _listed(case.requested)
        say("picture", f"the first AOV, {quoted(name)} ({kind}): no integrator is inside")
    return Decision("aov")


def _listed(requested: Integrator) -> tuple[tuple[str, str], ...]:
    """Return name and kind of each AOV. Without a list: every kind, under its own name."""
    return requested.aovs or tuple((kind, kind) for kind in AOV_KINDS)


def _show(film: NDArray[Any], requested: Integrator) -> Shown:
    """Return the AOVs by name; the first one is also the picture.

    With an inner integrator the picture is black: that integrator is rendered separately.
    """
    aovs = {
        name: np.ascontiguousarray(film[..., _CHANNELS[kind]])
        for name, kind in _listed(requested)
    }
    picture = as_picture(next(iter(aovs.values())))
    if requested.nested is not None:
        picture = np.zeros_like(picture)
    return Shown(picture, aovs, dict(_listed(requested)))


INTEGRATOR = IntegratorKind(
    "position, normals and other numbers of the first hit",
    first_hit.trace_first_hits,
    _decide,
    _read,
    channels=first_hit.CHANNELS,
    show=_show,
    first_hit=True,
)
