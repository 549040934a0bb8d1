"""The scene reader: turns a Mitsuba 3 file, text or dictionary into a SceneDescription.

All checks and default values are here, so the renderer only gets scenes that it can render.
Any error is a `SceneError` with one line: the place, what was found, and what is possible.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from renderer.errors import MissingFile, NotAllowed, SceneError
from renderer.scene_file.description import SceneDescription
from renderer.scene_file.document.dictionary import read_dictionary
from renderer.scene_file.document.references import Parameters, resolve
from renderer.scene_file.document.xml_tree import read_text_file, read_xml_tree
from renderer.scene_file.files import Bounds, Reading
from renderer.scene_file.objects.scenes import read_scene

__all__ = [
    "Folders",
    "SceneDescription",
    "SceneError",
    "read_dict",
    "read_file",
    "read_file_with",
    "read_string",
]


Folders = str | Path | Iterable[str | Path]


def read_file(
    path: str | Path, /, *, allow_outside: Folders = (), **parameters: object
) -> SceneDescription:
    """Read a Mitsuba 3 XML scene.

    Parameters
    ----------
    path
        The file. Files that it names are searched in its own folder (and in those of its
        `<path>` elements), then in the working directory.
    allow_outside
        Additional folders; files in their trees may be read too (docs/security.md).
    **parameters
        Values for `$name` in the file; they take precedence over `<default>` elements.

    Raises
    ------
    SceneError
        If the file, or one that it names, cannot be read, or is not supported.
    TypeError
        If `path` is not a path.
    """
    return read_file_with(path, parameters, allow_outside)


def read_file_with(
    path: str | Path, parameters: Mapping[str, object], allow_outside: Folders = ()
) -> SceneDescription:
    """Read as `read_file`; the names of parameters may be any strings."""
    _check_type("the path of the scene", path, (str, os.PathLike), "a str or a Path")
    path = Path(path)
    if not path.is_file():
        raise SceneError(f"{path}: no such scene file")
    bounds = Bounds.of(path.parent, allow_outside)
    reading = Reading([path.parent, Path.cwd()], bounds)
    reading.files[str(path)] = None
    try:
        return _read_xml(read_text_file(path), str(path), parameters, reading)
    except (MissingFile, NotAllowed):
        raise
    except SceneError as error:
        if not reading.old_version:
            raise
        raise type(error)(
            f"{error}; the scene is of version {reading.old_version}: "
            f"lightproof upgrade {path} writes it for Mitsuba 3"
        ) from None


def read_string(
    xml: str,
    /,
    *,
    base_dir: str | Path | None = None,
    allow_outside: Folders = (),
    **parameters: object,
) -> SceneDescription:
    """Read a scene from XML text.

    Parameters
    ----------
    xml
        The document.
    base_dir
        Folder of the scene; None: the working directory. Files that the document names are
        searched there, then in the working directory.
    allow_outside, **parameters
        As in `read_file`.

    Raises
    ------
    SceneError
        As `read_file`.
    TypeError
        If `xml` is not a text.
    """
    _check_type("the scene", xml, (str, bytes), "XML text (a str)")
    return _read_xml(xml, "<string>", parameters, _reading(base_dir, allow_outside))


def read_dict(
    content: Mapping[str, Any],
    *,
    base_dir: str | Path | None = None,
    allow_outside: Folders | None = None,
) -> SceneDescription:
    """Read a scene from a dictionary in the form of Mitsuba's `load_dict`.

    Parameters
    ----------
    content
        A dictionary with "type": "scene".
    base_dir
        As in `read_string`.
    allow_outside
        As in `read_file`. None allows files anywhere, since a program that passes a
        dictionary usually wrote its file names. Pass () if the names are from an untrusted
        source.

    Raises
    ------
    SceneError
        As `read_file`.
    """
    reading = _reading(base_dir, allow_outside)
    root = resolve(read_dictionary(content, reading))
    return read_scene(root, "<dictionary>", reading)


def _read_xml(
    content: str | bytes, source: str, parameters: Mapping[str, object], reading: Reading
) -> SceneDescription:
    tree = read_xml_tree(content, source, Parameters(parameters), reading)
    return read_scene(resolve(tree), source, reading)


def _reading(base_dir: str | Path | None, allow_outside: Folders | None) -> Reading:
    folders = [Path.cwd()]
    if base_dir is not None:
        _check_type("base_dir", base_dir, (str, os.PathLike), "a str or a Path")
        folders.insert(0, Path(base_dir))
    anywhere = folders[0].absolute().anchor
    others = anywhere if allow_outside is None else allow_outside
    return Reading(folders, Bounds.of(folders[0], others))


def _check_type(
    what: str, value: object, possible: tuple[type, ...], expected: str
) -> None:
    if not isinstance(value, possible):
        raise TypeError(f"{what} is of type {type(value).__name__}; possible is {expected}")
