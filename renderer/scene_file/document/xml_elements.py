"""Text and elements of an XML scene file, each with its line."""

from __future__ import annotations

import codecs
import re
from collections.abc import Collection
from dataclasses import dataclass, field
from xml.parsers import expat

from renderer.errors import SceneError
from renderer.process import memory
from renderer.scene_file.description import Location

# ----------------------------------------------------------------------------- xml text
# Reads XML text as tolerantly as Mitsuba's parser.
#
# Mitsuba's parser (pugixml) accepts invalid XML that people write by hand: two dashes or
# another encoding's characters in a comment, a blank line before the declaration, an `&` in
# a name. Expat does not. The corrections here change no element and no line number.

_MARKS = (  # longer ones first
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_DECLARATION = re.compile(r"(\s*)<\?xml\s.*?\?>", re.DOTALL)
_ENCODING = re.compile(
    rb"\s*<\?xml\s[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._:-]{1,40})[\"']"
)
# Matches whole tags too, so that a comment is found only where one can begin. An
# unterminated match takes the rest of the file, which would otherwise be searched again at
# each `<`.
_COMMENT = (
    r"(?P<comment><!--.*?-->)|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<[^!?](?:[^\"'>]|\"[^\"]*\"|'[^']*')*>|<(?:!--|!\[CDATA\[|[^!]).*"
)
_TEXT_COMMENT = re.compile(_COMMENT, re.DOTALL)
_BYTE_COMMENT = re.compile(_COMMENT.encode(), re.DOTALL)
_STRAY_AMPERSAND = re.compile(r"&(?![#A-Za-z][A-Za-z0-9]{0,31};)")
# Encodings in which the bytes of markup and paths are ASCII. Otherwise a file could look
# different to Mitsuba, which only decodes UTF and Latin-1.
_LIKE_ASCII = re.compile(
    r"ascii|utf-8|(iso8859-|cp125|koi8-|mac-|gb|big5|shift_jis|euc_|cp93|cp949|cp950).*"
)


def readable(content: str | bytes) -> str:
    """Return a document without declaration and comments, with `&` as an entity.

    Raises
    ------
    UnicodeError, LookupError
        If its encoding is unknown, or its bytes are invalid in it.
    """
    if isinstance(content, bytes):
        content = _decoded(content)
    content = _TEXT_COMMENT.sub(
        lambda m: "\n" * m["comment"].count("\n") if m["comment"] else m[0], content
    )
    if declaration := _DECLARATION.match(content):
        lines = "\n" * declaration[0].count("\n")
        content = lines + content[declaration.end() :]
    return _STRAY_AMPERSAND.sub("&amp;", content)


def _decoded(content: bytes) -> str:
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return content.decode(encoding)
    declared = _ENCODING.match(content)
    encoding = declared[1].decode() if declared else "utf-8"
    if encoding.lower().startswith("utf-16"):  # but it was read as bytes above
        encoding = "utf-8"
    if not _LIKE_ASCII.fullmatch(codecs.lookup(encoding).name):
        raise LookupError(f"the encoding {encoding} is not supported")
    rest = _BYTE_COMMENT.sub(
        lambda m: b"\n" * m["comment"].count(b"\n") if m["comment"] else m[0], content
    )
    return rest.decode(encoding)


# ------------------------------------------------------------------------- xml elements
# XML text to plain elements with line numbers, by expat; no entities, no DTD.
#
# The standard `ElementTree` does not store line numbers, and a message without one is
# useless in a file of a thousand lines.

_AT_ONCE = 4096  # elements between two checks of the available memory
_BYTES_AN_ELEMENT = 3000  # until it is an object of the scene
_DEEPEST = 100  # nested elements; keeps recursion far below Python's limit


@dataclass(eq=False)
class XmlElement:
    """One element of the file."""

    tag: str
    attributes: dict[str, str]
    location: Location
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""  # text between the children, without comments


def parse_xml(content: str | bytes, source: str) -> XmlElement:
    """Parse a document and return its root.

    Parameters
    ----------
    content
        The document; bytes have their encoding in the XML declaration (default UTF-8).
        Errors that Mitsuba's parser accepts are corrected (`readable`).
    source
        Name of the document, for messages.

    Raises
    ------
    SceneError
        If it is not well-formed, is nested too deeply, or has a DOCTYPE: entities could
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
    """Return a required attribute.

    Raises
    ------
    SceneError
        If it is missing.
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
