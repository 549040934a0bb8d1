"""Checks all files that a scene names, before another renderer reads the scene.

This reader stops at the first error. Another renderer may continue and open a file that a
later line names. Mitsuba also searches for the library of a plugin, `plugins/TYPE.so`, in
the folders of the scene's files before its own folder, and would run it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from renderer.errors import NotAllowed, SceneError
from renderer.scene_file.document.references import Parameters
from renderer.scene_file.document.xml_elements import XmlElement, parse_xml
from renderer.scene_file.document.xml_tree import DEEPEST_INCLUDE, read_text_file
from renderer.scene_file.files import Bounds, Reading
from renderer.scene_file.numbers import quoted

LIBRARIES = (".so", ".dylib", ".dll")


def check_named_files(
    path: Path, parameters: Mapping[str, object], allow_outside: Iterable[str] = ()
) -> None:
    """Refuse a scene that names a file which must not be read, or that contains code.

    Every string and every `filename` that is the path of an existing file is checked, in
    any element: its meaning may depend on plugins that this program does not know.

    Raises
    ------
    NotAllowed
        Names the first such file; or a library where Mitsuba searches for plugins; or the
        type of a plugin that is a path.
    SceneError
        If the check is not possible, because the XML cannot be read or includes itself.
    """
    bounds = Bounds.of(path.parent, allow_outside)
    reading = Reading([path.parent, Path.cwd()], bounds)
    _check_document(path, Parameters(parameters), reading, 0)


def _check_document(
    path: Path, parameters: Parameters, reading: Reading, depth: int
) -> None:
    if depth > DEEPEST_INCLUDE:
        raise SceneError(f"{path}: more than {DEEPEST_INCLUDE} files include each other")
    for folder in reading.folders:
        _check_no_library(folder, str(path))
    waiting = [parse_xml(read_text_file(path), str(path))]
    while waiting:  # in the order of the file: a <default> applies to the lines after it
        element = waiting.pop()
        waiting += reversed(element.children)
        found = element.attributes
        for name, value in found.items():
            found[name] = parameters.substitute(value, element.location)
        if any(part in found.get("type", "") for part in ("/", "\\", "..")):
            raise NotAllowed(
                f"{element.location}: the type {quoted(found['type'])} is a path; possible "
                "is the name of a plugin"
            )
        if element.tag == "default":
            parameters.add_default(found.get("name", ""), found.get("value", ""))
        elif element.tag == "path":
            _add_folder(element, reading)
        elif named := found.get("filename") or (
            found.get("value") if element.tag == "string" else None
        ):
            file = _check(named, element, reading)
            if element.tag == "include" and file is not None:
                inner = Reading([file.parent, *reading.folders], reading.bounds)
                _check_document(file, parameters, inner, depth + 1)


def _check(named: str, element: XmlElement, reading: Reading) -> Path | None:
    """Return the file with that name, or None if it does not exist."""
    for folder in reading.folders:
        try:
            there = (folder / named).exists()
        except (OSError, ValueError):  # not a possible file name
            return None
        if there and not (folder / named).is_dir():  # "rgb" may be a folder as well
            return reading.find_file(named, element.location, "the file")
    return None


def _add_folder(element: XmlElement, reading: Reading) -> None:
    name = element.attributes.get("value", "")
    for folder in reading.folders:
        if (folder / name).is_dir():
            reading.bounds.check(folder / name, f"{element.location}: the folder")
            _check_no_library(folder / name, str(element.location))
            reading.folders.insert(0, folder / name)
            return


def _check_no_library(folder: Path, where: str) -> None:
    try:
        inside = sorted((folder / "plugins").iterdir())
    except OSError:  # the folder does not exist or is not readable
        return
    for file in inside:
        if file.suffix.lower() in LIBRARIES:
            raise NotAllowed(
                f"{where}: {file} is a library, which Mitsuba would run as a plugin; "
                "possible is the scene in a folder without it"
            )
