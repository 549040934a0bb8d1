"""XML scene files to trees of elements with file and line; also of older versions."""

from __future__ import annotations

import re
from pathlib import Path

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.description import Location
from renderer.scene_file.document import xml_tree as version_1
from renderer.scene_file.document.references import Parameters
from renderer.scene_file.document.xml_elements import (
    XmlElement,
    check_attributes,
    parse_xml,
)
from renderer.scene_file.document.xml_values import STEPS, VALUE_TAGS, read_value
from renderer.scene_file.files import Reading, find
from renderer.scene_file.numbers import quoted
from renderer.scene_file.plugins import TAGS
from renderer.scene_file.tree import UNNAMED, Element, Tree

# ---------------------------------------------------------------------------- version 1
# Files of Mitsuba 0.x (version < 2): property names are replaced by the current ones.
#
# As in Mitsuba 3, only names change; other differences in such files are errors.

# A lower-case letter, then capitals: toWorld, intIOR (int_ior).
_CAMEL_CASE = re.compile(r"(?<=[a-z])[A-Z]+")
_VERSION = re.compile(r"([0-9]{1,9})\.[0-9]{1,9}\.[0-9]{1,9}")


def is_version_1(version: str, location: Location) -> bool:
    """Return whether a version attribute is below 2.0.0.

    Raises
    ------
    SceneError
        If it is not a version number.
    """
    match = _VERSION.fullmatch(version.strip())
    if not match:
        raise SceneError(
            f'{location}: version is {quoted(version)}; expected three numbers like "3.0.0"'
        )
    return int(match[1]) < 2


def current_name(plugin: str, name: str) -> str:
    """Return the name in Mitsuba 3 of a property of a plugin of Mitsuba 0.x."""
    name = _CAMEL_CASE.sub(lambda capitals: "_" + capitals[0].lower(), name)
    if plugin == "diffuse" and name == "diffuse_reflectance":
        return "reflectance"
    return name


def upgrade(element: Element) -> None:
    """Rename the properties of an element in place; combine the four old uv properties."""
    old = list(element.properties.values())
    element.properties.clear()
    offset, factor = [0.0, 0.0, 0.0], [1.0, 1.0, 1.0]
    place = None  # location of the last of the old uv properties
    for property_ in old:
        name = current_name(element.plugin, property_.name)
        if name in ("uoffset", "voffset", "uscale", "vscale"):
            if isinstance(property_.value, bool) or not isinstance(
                property_.value, int | float
            ):
                raise SceneError(
                    f'{property_.location}: {element}, property "{name}": found a '
                    f"{property_.kind}, expected a float"
                )
            numbers = offset if name.endswith("offset") else factor
            numbers["uv".index(name[0])] = float(property_.value)
            place = property_.location
        else:
            element.add(name, property_.value, property_.location)
    if place is not None:
        to_uv = transforms.scale(*factor) @ transforms.translate(*offset)
        element.add("to_uv", to_uv, place)


# ----------------------------------------------------------------------------- xml tree
# XML elements to trees: plugins, parameters, includes, ids.
#
# Tags and attributes have the meaning that they have in Mitsuba; others are errors, as in
# Mitsuba.

DEEPEST_INCLUDE = 15  # as in Mitsuba
_OTHER_TAGS = ("default", "include", "path", "alias")


def read_xml_tree(
    content: str | bytes, source: str, parameters: Parameters, reading: Reading
) -> Tree:
    """Read a scene and its includes.

    Parameters
    ----------
    content
        The XML document.
    source
        Its path, or a name for messages.
    reading
        Its `folders` are searched for included files; `<path>` adds to them.

    Raises
    ------
    SceneError
        For everything that Mitsuba's parser refuses, and for DOCTYPEs.
    """
    document = _Document(source, parameters, reading, (Path(source).resolve(),))
    tree = document.read(content)
    parameters.check_all_used(source)
    return tree


class _Document:
    """Reads one XML file; each included file has its own object."""

    def __init__(
        self, source: str, parameters: Parameters, reading: Reading, stack: tuple[Path, ...]
    ) -> None:
        self._source = source
        self._parameters = parameters
        self._reading = reading  # its folders are those of this document
        self._stack = stack  # this file and the files that include it
        self._ids: dict[str, Element] = {}
        self._is_version_1 = False

    def read(self, content: str | bytes) -> Tree:
        """Read the whole document."""
        root = parse_xml(content, self._source)
        if "version" not in root.attributes:
            raise SceneError(
                f'{root.location}: <{root.tag}> lacks the attribute "version" (such as '
                '"3.0.0")'
            )
        self._substitute(root)
        self._is_version_1 = version_1.is_version_1(
            root.attributes["version"], root.location
        )
        if self._is_version_1:
            self._reading.old_version = root.attributes["version"].strip()
        return Tree(self._object(root, is_root=True), self._ids)

    def _object(self, xml: XmlElement, *, is_root: bool = False) -> Element:
        """Read a plugin and its children; its parameters are already replaced."""
        if xml.tag not in TAGS:
            self._refuse_tag(xml)
        optional = {"id", "name"} | ({"version", "type"} if is_root else set())
        check_attributes(xml, () if is_root else ("type",), optional)
        plugin = xml.attributes.get("type", "scene")
        tag = "texture" if xml.tag == "spectrum" else xml.tag
        element = Element(tag, plugin, xml.location, xml.attributes.get("id", ""))
        if element.id:
            self._register(element.id, element, xml.location)
        for child in xml.children:
            self._child(child, element, in_root=is_root)
        self._mention_text(xml)
        if self._is_version_1:
            version_1.upgrade(element)
        return element

    def _child(self, xml: XmlElement, parent: Element, *, in_root: bool) -> None:
        """Read one element inside a plugin, and add it as a property."""
        self._substitute(xml)
        name = xml.attributes.get("name", "")
        if xml.tag in TAGS and xml.tag != "spectrum":
            parent.add(name, self._object(xml), xml.location)
        elif xml.tag == "spectrum" and "type" in xml.attributes:
            parent.add(name, self._object(xml), xml.location)
        elif xml.tag in VALUE_TAGS:
            if xml.children and xml.tag != "transform":
                raise SceneError(
                    f"{xml.children[0].location}: <{xml.tag}> takes no elements inside"
                )
            for step in xml.children:
                self._substitute(step)
            parent.add(name, read_value(xml, self._reading), xml.location)
        elif xml.tag == "default":
            check_attributes(xml, ("name", "value"))
            if not name:
                raise SceneError(f"{xml.location}: <default> has an empty name")
            self._parameters.add_default(name, xml.attributes["value"])
        elif xml.tag == "include":
            self._include(xml, parent)
        elif xml.tag == "path":
            self._path(xml, in_root=in_root)
        elif xml.tag == "alias":
            self._alias(xml)
        else:
            self._refuse_tag(xml)

    def _include(self, xml: XmlElement, parent: Element) -> None:
        """Read another file; a scene adds its children, another root adds itself."""
        check_attributes(xml, ("filename",), {"name"})
        where = xml.location
        filename = xml.attributes["filename"]
        path = self._reading.find_file(filename, where, "the included file")
        resolved = path.resolve()
        if resolved in self._stack:
            chain = " -> ".join(p.name for p in (*self._stack, resolved))
            raise SceneError(f"{where}: cyclic <include>: {chain}")
        if len(self._stack) >= DEEPEST_INCLUDE:
            raise SceneError(
                f"{where}: more than {DEEPEST_INCLUDE} files include each other"
            )
        # `<path>` elements of an included file are only valid inside of it.
        folders = [path.parent, *self._reading.folders]
        reading = self._reading
        inner = Reading(folders, reading.bounds, reading.warnings, reading.files)
        document = _Document(str(path), self._parameters, inner, (*self._stack, resolved))
        tree = document.read(read_text_file(path))
        for id_, element in tree.elements.items():
            self._register(id_, element, element.location)
        if tree.root.tag != "scene":
            parent.add(xml.attributes.get("name", ""), tree.root, where)
            return
        for property_ in tree.root.properties.values():
            if not isinstance(property_.value, Element):
                raise SceneError(
                    f"{property_.location}: {property_.kind} in an included scene, which "
                    "Mitsuba would drop; an included scene may hold plugins and <default>"
                )
            name = "" if property_.name.startswith(UNNAMED) else property_.name
            parent.add(name, property_.value, property_.location)

    def _path(self, xml: XmlElement, *, in_root: bool) -> None:
        check_attributes(xml, ("value",))
        if not in_root:
            raise SceneError(
                f"{xml.location}: <path> must stand directly in the root element"
            )
        reading, name = self._reading, xml.attributes["value"]
        folder = find(name, reading.folders, reading.bounds, xml.location, "the folder")
        if not folder.is_dir():
            raise SceneError(f"{xml.location}: <path> {quoted(name)} is not a folder")
        reading.folders.insert(0, folder)

    def _alias(self, xml: XmlElement) -> None:
        check_attributes(xml, ("id", "as"))
        id_ = xml.attributes["id"]
        if id_ not in self._ids:
            raise SceneError(
                f"{xml.location}: <alias> of {quoted(id_)}, which is no id so far"
            )
        self._register(xml.attributes["as"], self._ids[id_], xml.location)

    def _register(self, id_: str, element: Element, where: Location) -> None:
        if id_ in self._ids:
            raise SceneError(
                f"{where}: id {quoted(id_)} is taken already, by {self._ids[id_]} at "
                f"{self._ids[id_].location}"
            )
        self._ids[id_] = element

    def _substitute(self, xml: XmlElement) -> None:
        for name, value in xml.attributes.items():
            xml.attributes[name] = self._parameters.substitute(value, xml.location)

    def _mention_text(self, xml: XmlElement) -> None:
        if xml.text:
            self._reading.warn(xml.location, f"text inside <{xml.tag}>: {quoted(xml.text)}")

    def _refuse_tag(self, xml: XmlElement) -> None:
        if xml.tag in STEPS:
            raise SceneError(f"{xml.location}: <{xml.tag}> belongs inside a <transform>")
        supported = ", ".join(sorted({*TAGS, *VALUE_TAGS, *_OTHER_TAGS}))
        raise SceneError(
            f"{xml.location}: the element <{xml.tag}> is not supported; "
            f"supported: {supported}"
        )


def read_text_file(path: Path) -> bytes:
    """Return the bytes of an XML file.

    Raises
    ------
    SceneError
        If it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise SceneError(f"{path}: cannot read the file: {error.strerror}") from None
