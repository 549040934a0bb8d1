"""The scene reader: a Mitsuba 3 file, text or dictionary becomes a SceneDescription.

Everything is checked and every default filled in here, so that the renderer behind it
only meets scenes that it can render. Whatever is wrong or not supported is one
`SceneError` of one line: where, what was found, what is possible.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from renderer.errors import SceneError
from renderer.scene_file.description import SceneDescription
from renderer.scene_file.document.dictionary import read_dictionary
from renderer.scene_file.document.parameters import Parameters
from renderer.scene_file.document.references import resolve
from renderer.scene_file.document.xml_tree import read_text_file, read_xml_tree
from renderer.scene_file.objects.scenes import read_scene
from renderer.scene_file.reading import Reading

__all__ = ["SceneDescription", "SceneError", "read_dict", "read_file", "read_string"]


def read_file(path: str | Path, /, **parameters: object) -> SceneDescription:
    """Read a Mitsuba 3 XML scene.

    Parameters
    ----------
    path
        The file. What it names is looked for in its own folder (and in those of its
        `<path>` elements), then in the working directory.
    **parameters
        Values for `$name` in the file; they win over its `<default>` elements.

    Raises
    ------
    SceneError
        If the file, or one that it names, cannot be read or rendered.
    TypeError
        If `path` is no path.
    """
    _check_type("the path of the scene", path, (str, os.PathLike), "a str or a Path")
    path = Path(path)
    if not path.is_file():
        raise SceneError(f"{path}: no such scene file")
    reading = Reading([path.parent, Path.cwd()])
    reading.files[str(path)] = None
    return _read_xml(read_text_file(path), str(path), parameters, reading)


def read_string(
    xml: str, /, *, base_dir: str | Path | None = None, **parameters: object
) -> SceneDescription:
    """Read a scene from XML text.

    Parameters
    ----------
    xml
        The document.
    base_dir
        Where the files that it names are looked for first; then in the working
        directory.
    **parameters
        As in `read_file`.

    Raises
    ------
    SceneError
        As `read_file`.
    TypeError
        If `xml` is no text.
    """
    _check_type("the scene", xml, (str, bytes), "XML text (a str)")
    return _read_xml(xml, "<string>", parameters, Reading(_folders(base_dir)))


def read_dict(
    content: Mapping[str, Any], *, base_dir: str | Path | None = None
) -> SceneDescription:
    """Read a scene from a dictionary in the form of Mitsuba's `load_dict`.

    Parameters
    ----------
    content
        A dictionary with "type": "scene".
    base_dir
        As in `read_string`.

    Raises
    ------
    SceneError
        As `read_file`.
    """
    reading = Reading(_folders(base_dir))
    root = resolve(read_dictionary(content, reading))
    return read_scene(root, "<dictionary>", reading)


def _read_xml(
    content: str | bytes, source: str, parameters: Mapping[str, object], reading: Reading
) -> SceneDescription:
    tree = read_xml_tree(content, source, Parameters(parameters), reading)
    return read_scene(resolve(tree), source, reading)


def _folders(base_dir: str | Path | None) -> list[Path]:
    if base_dir is not None:
        _check_type("base_dir", base_dir, (str, os.PathLike), "a str or a Path")
    return [Path.cwd()] if base_dir is None else [Path(base_dir), Path.cwd()]


def _check_type(
    what: str, value: object, possible: tuple[type, ...], expected: str
) -> None:
    if not isinstance(value, possible):
        raise TypeError(f"{what} is of type {type(value).__name__}; possible is {expected}")
