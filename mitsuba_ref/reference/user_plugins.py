"""A user's plugins written in Python, made known to Mitsuba before it loads a scene."""

from __future__ import annotations

import functools

from mitsuba_ref.reference.errors import MitsubaRefused
from mitsuba_ref.reference.variant import load_mitsuba
from renderer.errors import SceneError
from renderer.scene_file.plugin_file import import_plugin_file, neighbours_importable


@functools.cache
def register_user_plugins(path: str) -> None:
    """Call `register_mitsuba()` of a plugin file, if it has one, once in this process.

    Raises
    ------
    MitsubaRefused
        If the file or the function raises; one line that names the file.
    """
    load_mitsuba()  # a plugin is registered with the variant that is set
    try:
        register = getattr(import_plugin_file(path), "register_mitsuba", None)
    except SceneError as error:
        raise MitsubaRefused(str(error)) from error
    if register is None:
        return
    try:
        with neighbours_importable(path):
            register()
    except Exception as error:
        what = f"register_mitsuba(): {type(error).__name__}: {error}"
        raise MitsubaRefused(f"{path}: {what}") from error
