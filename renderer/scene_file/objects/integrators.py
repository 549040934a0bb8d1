"""Integrators: those that are registered, and what all of them have."""

from __future__ import annotations

import dataclasses

from renderer.scene_file.description import Integrator
from renderer.scene_file.document.tree import Element
from renderer.scene_file.plugins import registered_kinds
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading


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
    integrator: Integrator = registered_kinds("integrator")[element.plugin].read(properties)
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
