"""Integrators: those that are registered, and what all of them have.

One that is not supported is no error yet: its scene can be rendered by another one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from renderer.process.names import INTEGRATORS
from renderer.scene_file.description import Integrator
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.read_context import Reading
from renderer.scene_file.tree import Element

_OF_VOLUMES = ("volpath", "volpathmis")
# Shadow rays of these see through such BSDFs, those of path do not.
_SEEN_THROUGH = ("null", "mask", "thindielectric")


def read_integrator(element: Element | None, reading: Reading) -> Integrator:
    """Read an `<integrator>`; None is Mitsuba's default, `path` without a depth limit.

    Of one that is not supported nothing is read but its name, and `refusal` says why.

    Raises
    ------
    SceneError
        If something in it is wrong.
    """
    if element is None:
        return Integrator()
    kinds = registered_kinds("integrator")
    plugin = "path" if element.plugin in _OF_VOLUMES else element.plugin
    if plugin not in kinds:
        possible = ", ".join(kinds)
        return _refused(element, f"not supported; supported integrator plugins: {possible}")
    # of volumes it is `path` to the rest of the reader
    properties = Properties(dataclasses.replace(element, plugin=plugin), reading)
    integrator: Integrator = kinds[plugin].read(properties)
    if plugin != element.plugin:
        properties.boolean("use_spectral_mis", True)
        integrator = dataclasses.replace(integrator, stands_for=element.plugin)
        properties.element = element  # as messages shall name it
    # how Mitsuba divides its work: of interest for a replay of its numbers alone
    block_size = properties.integer("block_size", 0, at_least=0)
    one_pass = not properties.has("samples_per_pass")
    properties.integer("samples_per_pass", 1, at_least=1)
    timeout = properties.number("timeout", -1.0)
    if timeout > 0.0:
        properties.fail(
            "timeout", f"{timeout:g} s", "none: pictures are always finished here"
        )
    properties.finish()
    return dataclasses.replace(integrator, block_size=block_size, one_pass=one_pass)


def read_scene_integrator(
    element: Element | None, scene: Element, reading: Reading
) -> Integrator:
    """Read the integrator of a scene whose references are resolved.

    Where `path` stands for one of volumes the expected picture has to be the same: there
    are no media (this renderer has none), and no BSDF that its shadow rays see through.

    Raises
    ------
    SceneError
        As `read_integrator`.
    """
    integrator = read_integrator(element, reading)
    nested = integrator.nested or integrator
    if element is None or not nested.stands_for:
        return integrator
    plugins = {e.plugin: e for e in _below(scene) if e.tag == "bsdf"}
    through = next((plugins[name] for name in _SEEN_THROUGH if name in plugins), None)
    if through is not None:
        return _refused(
            element,
            f"not supported where {nested.stands_for} meets {through} "
            f"({through.location}): its shadow rays pass it, those of path do not",
        )
    reading.warn(
        element.location,
        f"{nested.stands_for} is rendered by path: without media both have the same "
        "expected picture",
    )
    return integrator


def _refused(element: Element, why: str) -> Integrator:
    others = ", ".join(name for name in INTEGRATORS if name not in ("auto", "path"))
    return Integrator(
        element.plugin,
        refusal=f"{element.location}: {element} is {why}; --integrator path, or in Python "
        f'render(scene, integrator="path"), renders the scene with path ({others} are '
        "possible too)",
    )


def _below(element: Element) -> Iterator[Element]:
    """Yield an element and all that are inside of it or referenced, each once."""
    seen: set[int] = set()
    waiting = [element]
    while waiting:
        current = waiting.pop()
        if id(current) not in seen:
            seen.add(id(current))
            yield current
            values = (property_.value for property_ in current.properties.values())
            waiting += [value for value in values if isinstance(value, Element)]
