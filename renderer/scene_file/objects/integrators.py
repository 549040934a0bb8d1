"""Integrators: direct, whitted, path, depth, and aov around another one."""

from __future__ import annotations

import dataclasses

from renderer.errors import SceneError
from renderer.scene_file.description import AOV_KINDS, Integrator
from renderer.scene_file.document.tree import Element
from renderer.scene_file.numbers import quoted, split_list
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading

_MOST = 2**31 - 1


def read_integrator(element: Element | None, reading: Reading) -> Integrator:
    """Read an `<integrator>`; None is Mitsuba's default, `path` without a depth limit.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    if element is None:
        return Integrator()
    properties = Properties(element, reading)
    match element.plugin:
        case "path":
            integrator = Integrator(
                "path",
                max_depth=properties.integer("max_depth", -1, at_least=-1, at_most=_MOST),
                rr_depth=properties.integer("rr_depth", 5, at_least=1, at_most=_MOST),
                hide_emitters=properties.boolean("hide_emitters", False),
            )
        case "whitted":
            integrator = Integrator(
                "whitted",
                max_depth=properties.integer("max_depth", 8, at_least=-1, at_most=_MOST),
                hide_emitters=properties.boolean("hide_emitters", False),
                cutoff=properties.number("cutoff", 1.0 / 1024.0, above=0.0, at_most=1.0),
            )
        case "direct":
            integrator = _direct(properties)
        case "depth":
            properties.boolean("hide_emitters", False)  # distances have no emitters
            integrator = Integrator("depth")
        case _:
            integrator = _aov(properties)
    integrator = _with_work(integrator, properties)
    properties.finish()
    return integrator


def _with_work(integrator: Integrator, properties: Properties) -> Integrator:
    """Read how Mitsuba divides its work: of interest for a replay of its numbers alone."""
    block_size = properties.integer("block_size", 0, at_least=0)
    one_pass = not properties.has("samples_per_pass")
    properties.integer("samples_per_pass", 1, at_least=1)
    timeout = properties.number("timeout", -1.0)
    if timeout > 0.0:
        properties.fail(
            "timeout", f"{timeout:g} s", "none: pictures are always finished here"
        )
    return dataclasses.replace(integrator, block_size=block_size, one_pass=one_pass)


def _direct(properties: Properties) -> Integrator:
    both = properties.has("shading_samples")
    separate = [n for n in ("emitter_samples", "bsdf_samples") if properties.has(n)]
    if both and separate:
        properties.fail(separate[0], 'a value beside "shading_samples"', "one of the two")
    shared = properties.integer("shading_samples", 1, at_least=1, at_most=_MOST)
    # Mitsuba takes 0 and then shows no point light; nobody can want that
    emitter_samples = properties.integer(
        "emitter_samples", shared, at_least=1, at_most=_MOST
    )
    bsdf_samples = properties.integer("bsdf_samples", shared, at_least=0, at_most=_MOST)
    return Integrator(
        "direct",
        max_depth=2,
        hide_emitters=properties.boolean("hide_emitters", False),
        emitter_samples=emitter_samples,
        bsdf_samples=bsdf_samples,
    )


def _aov(properties: Properties) -> Integrator:
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
    nested = properties.child("integrator")
    if nested is not None and nested.plugin == "aov":
        raise SceneError(
            f"{nested.location}: an aov integrator inside of another one is not supported; "
            "write all aovs in one list"
        )
    return Integrator(
        "aov",
        hide_emitters=properties.boolean("hide_emitters", False),
        aovs=tuple(aovs),
        nested=None if nested is None else read_integrator(nested, properties.reading),
    )
