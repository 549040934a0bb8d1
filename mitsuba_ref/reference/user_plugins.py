"""A user's plugins written in Python, made known to Mitsuba before it loads a scene."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Iterator
from contextlib import contextmanager

from mitsuba_ref.reference.variant import load_mitsuba
from renderer.errors import PluginError
from renderer.process.source_places import definition_of
from renderer.scene_file.plugin_file import (
    import_plugin_file,
    neighbours_importable,
    plugin_error,
)
from renderer.scene_file.plugins import registered_kinds

REGISTER = "register_mitsuba"
HOW = 'docs/adding-a-bsdf.md, "Compare it with Mitsuba", shows how'


@functools.cache
def register_user_plugins(path: str) -> None:
    """Call `register_mitsuba()` of a plugin file, if it has one, once in this process.

    Raises
    ------
    PluginError
        If the file or the function raises; one line with the file and the line.
    """
    load_mitsuba()  # a plugin is registered with the variant that is set
    register = getattr(import_plugin_file(path), REGISTER, None)
    if register is None:
        return
    try:
        with neighbours_importable(path):
            register()
    except Exception as error:
        raise plugin_error(error, path, f"{REGISTER}(): ") from error


@contextmanager
def twins_explained(path: str | None) -> Iterator[None]:
    """Say why Mitsuba does not know a BSDF that a plugin file registers with us.

    Parameters
    ----------
    path
        The plugin file; None: there is none.

    Raises
    ------
    PluginError
        In the place of Mitsuba's own refusal.
    """
    try:
        yield
    except RuntimeError as error:
        unknown = re.search(r'Plugin "(.+?)" not found', str(error))
        if path is None or unknown is None:
            raise
        name = unknown[1]
        if not getattr(registered_kinds("bsdf").get(name), "source", ""):
            raise  # no BSDF of a user's
        module = import_plugin_file(path)
        register = getattr(module, REGISTER, None)
        if register is None:
            similar = difflib.get_close_matches(REGISTER, list(vars(module)), n=1)
            raise PluginError(
                f"it has no {REGISTER}(), so that Mitsuba does not know BSDF {name!r}"
                + (f" (its {similar[0]} is not called)" if similar else "")
                + f"; {HOW}",
                path,
            ) from error
        raise PluginError(
            f"{REGISTER}() registers no BSDF {name!r} with Mitsuba, as "
            f"mitsuba.register_bsdf({name!r}, ...) does; {HOW}",
            definition_of(register) or path,
        ) from error
