"""The text of an XML file, as forgiving as the parser that scene files are written for.

Mitsuba's (pugixml) takes what the standard forbids and people write by hand: two dashes
or another encoding's letters in a comment, a blank line before the declaration, an `&` in
a name. Expat does not. What is changed here changes no element, and no line number.
"""

from __future__ import annotations

import codecs
import re

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
# Whole tags too, so that a comment is found only where one can begin; what does not end
# takes the rest of the file, which would otherwise be searched again at each `<`.
_COMMENT = (
    r"(?P<comment><!--.*?-->)|<!\[CDATA\[.*?\]\]>|<\?.*?\?>"
    r"|<[^!?](?:[^\"'>]|\"[^\"]*\"|'[^']*')*>|<(?:!--|!\[CDATA\[|[^!]).*"
)
_TEXT_COMMENT = re.compile(_COMMENT, re.DOTALL)
_BYTE_COMMENT = re.compile(_COMMENT.encode(), re.DOTALL)
_STRAY_AMPERSAND = re.compile(r"&(?![#A-Za-z][A-Za-z0-9]{0,31};)")
# Encodings in which markup and paths are the bytes of ASCII and nothing else is: a file
# must not look otherwise to Mitsuba, which decodes UTF and Latin-1 alone.
_LIKE_ASCII = re.compile(
    r"ascii|utf-8|(iso8859-|cp125|koi8-|mac-|gb|big5|shift_jis|euc_|cp93|cp949|cp950).*"
)


def readable(content: str | bytes) -> str:
    """Return a document without its declaration and comments, and every `&` an entity.

    Raises
    ------
    UnicodeError, LookupError
        If its encoding is unknown, or not what it says it is.
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
    if encoding.lower().startswith("utf-16"):  # but a byte a character, as was seen above
        encoding = "utf-8"
    if not _LIKE_ASCII.fullmatch(codecs.lookup(encoding).name):
        raise LookupError(f"the encoding {encoding} is not supported")
    rest = _BYTE_COMMENT.sub(
        lambda m: b"\n" * m["comment"].count(b"\n") if m["comment"] else m[0], content
    )
    return rest.decode(encoding)
