"""XML text to plain elements with line numbers, by expat; no entities, no DTD.

The standard `ElementTree` forgets line numbers, and a message without one is of no use
in a file of a thousand lines.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from xml.parsers import expat

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.description import Location
from renderer.scene_file.document.xml.xml_text import readable

_AT_ONCE = 4096  # elements, between two looks at how much memory is left
_BYTES_AN_ELEMENT = 3000  # until it is an object of the scene
_DEEPEST = 100  # nested elements; keeps the recursive readers far from Python's limit


@dataclass(eq=False)
class XmlElement:
    """One element as it stands in the file."""

    tag: str
    attributes: dict[str, str]
    location: Location
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""  # what stands between the children, outside of comments


def parse_xml(content: str | bytes, source: str) -> XmlElement:
    """Read a document and return its root.

    Parameters
    ----------
    content
        The document; bytes say their encoding in the XML declaration (default UTF-8).
        Mistakes that Mitsuba's parser overlooks are mended (`readable`).
    source
        Its name, for messages.

    Raises
    ------
    SceneError
        If it is not well-formed, nests too deeply, or has a DOCTYPE: entities could
        read other files or grow without bound, and no scene needs them.
    """
    parser = expat.ParserCreate(encoding="utf-8")
    parser.buffer_text = True
    roots: list[XmlElement] = []
    open_elements: list[XmlElement] = []
    count = 0
    memory.require(max(4 * len(content), memory.SMALL + 1), source)

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count % _AT_ONCE == 0:
            memory.require(_AT_ONCE * _BYTES_AN_ELEMENT, f"{source}: more elements")
        location = Location(source, parser.CurrentLineNumber)
        element = XmlElement(tag, attributes, location)
        if len(open_elements) >= _DEEPEST:
            raise SceneError(f"{location}: more than {_DEEPEST} elements inside each other")
        (open_elements[-1].children if open_elements else roots).append(element)
        open_elements.append(element)

    def text(data: str) -> None:
        if open_elements and not data.isspace():
            open_elements[-1].text += data

    def doctype(*_: object) -> None:
        raise SceneError(
            f"{source}:{parser.CurrentLineNumber}: XML entities and DOCTYPE are "
            'not allowed; write the values out, or use <default name="..."/> and $name'
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _tag: open_elements.pop()
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(readable(content), True)
    except expat.ExpatError as error:
        reason = expat.ErrorString(error.code)
        raise SceneError(
            f"{source}:{error.lineno}: not well-formed XML: {reason}"
        ) from None
    except (UnicodeError, LookupError) as error:
        raise SceneError(f"{source}:1: cannot decode the XML file: {error}") from None
    return roots[0]


def required(element: XmlElement, name: str) -> str:
    """Return an attribute that must be there.

    Raises
    ------
    SceneError
        If it is not.
    """
    if name not in element.attributes:
        raise SceneError(
            f'{element.location}: <{element.tag}> lacks the attribute "{name}"'
        )
    return element.attributes[name]


def check_attributes(
    element: XmlElement, needed: tuple[str, ...], optional: Collection[str] = ()
) -> None:
    """Check that an element has the attributes of its tag and no others.

    Raises
    ------
    SceneError
        Naming one that is missing or unknown.
    """
    for name in needed:
        required(element, name)
    if unknown := [n for n in element.attributes if n not in needed and n not in optional]:
        known = {*needed, *optional}
        raise SceneError(
            f'{element.location}: <{element.tag}> has no attribute "{min(unknown)}"; '
            f"it takes: {', '.join(sorted(known))}"
        )
