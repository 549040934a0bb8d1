"""A user's plugins written in Python, made known to Mitsuba before it loads a scene."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Iterator
from contextlib import contextmanager

from mitsuba_ref.reference.variant import load_mitsuba
from renderer.errors import PluginError
from renderer.process.source_places import (
    definition_of,
    is_users_file,
    place_of_error,
    shown_place,
)
from renderer.scene_file.plugins import (
    import_plugin_file,
    neighbours_importable,
    plugin_error,
    registered_kinds,
)

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
    """Raise the error of a user's BSDF in Mitsuba, if the scene is not the cause.

    Parameters
    ----------
    path
        The plugin file, or None.

    Raises
    ------
    PluginError
        If Mitsuba does not know a BSDF that the file registers with us, or the user's code
        has raised. It replaces Mitsuba's message.
    """
    try:
        yield
    except PluginError:
        raise
    except Exception as error:
        if path is None:
            raise
        unknown = re.search(r'Plugin "(.+?)" not found', str(error))
        if unknown is not None and _is_users_bsdf(unknown[1]):
            raise _missing_twin(path, unknown[1]) from error
        unread = re.search(
            r'unreferenced propert\w+ in bsdf plugin of type "(.+?)".*? "(\w+)":',
            str(error),
            re.DOTALL,
        )
        if unread is not None and _is_users_bsdf(unread[1]):
            raise _unread_property(path, *unread.groups()) from error
        place, said = place_of_error(error), f"{type(error).__name__}: {error}"
        quoted = re.findall(r'File "(.+?)", line (\d+)', str(error))
        # Mitsuba quotes Python's whole traceback in its own message
        for file, line in quoted:
            if is_users_file(file):
                place, said = shown_place(file, int(line)), str(error).splitlines()[-1]
        if not place:
            raise
        raise PluginError(f"in Mitsuba: {said}", place) from error


def _is_users_bsdf(name: str) -> bool:
    return bool(getattr(registered_kinds("bsdf").get(name), "source", ""))


def _unread_property(path: str, name: str, key: str) -> PluginError:
    """Return that a BSDF in Mitsuba leaves out a parameter that a scene gives."""
    register = getattr(import_plugin_file(path), REGISTER, None)
    return PluginError(
        f"in Mitsuba, BSDF {name!r} does not read its parameter {key!r}, as "
        f"props.get_texture({key!r}, default) does; {HOW}",
        definition_of(register) or path,
    )


def _missing_twin(path: str, name: str) -> PluginError:
    """Return why Mitsuba does not know a BSDF that a plugin file registers with us."""
    module = import_plugin_file(path)
    register = getattr(module, REGISTER, None)
    if register is not None:
        return PluginError(
            f"{REGISTER}() registers no BSDF {name!r} with Mitsuba, as "
            f"mitsuba.register_bsdf({name!r}, ...) does; {HOW}",
            definition_of(register) or path,
        )
    similar = difflib.get_close_matches(REGISTER, list(vars(module)), n=1)
    return PluginError(
        f"it has no {REGISTER}(), so that Mitsuba does not know BSDF {name!r}"
        + (f" (its {similar[0]} is not called)" if similar else "")
        + f"; {HOW}",
        path,
    )
