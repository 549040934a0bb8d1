"""Changes to the text of an XML file that leave its layout and comments as they are.

A parser and a serializer would lose both: elements are found with their places in the
text, and only what a change names is replaced.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from html import unescape
from xml.sax.saxutils import escape

Span = tuple[int, int]  # [begin, end) in the text

_TOKEN = re.compile(
    r"<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|<!.*?>"
    r"|<(?P<close>/?)(?P<tag>[^\s/>]+)(?P<rest>(?:[^\"'>]|\"[^\"]*\"|'[^']*')*)>",
    re.DOTALL,
)
_REST_OF_LINE = re.compile(r"[ \t]*\r?\n")
_ATTRIBUTE = re.compile(r"([^\s=]+)\s*=\s*([\"'])(.*?)\2", re.DOTALL)


@dataclass(eq=False)
class Node:
    """One element with its places in the text."""

    tag: str
    line: int
    begin: int  # of the element
    opened: int = 0  # behind its first tag
    end: int = 0
    tag_spans: list[Span] = field(default_factory=list)  # of one tag or of both
    attributes: dict[str, str] = field(default_factory=dict)
    value_spans: dict[str, Span] = field(default_factory=dict)  # without the quotes
    attribute_spans: dict[str, Span] = field(default_factory=dict)
    children: list[Node] = field(default_factory=list)


class EditedXml:
    """The text of a well-formed document, and the changes that are to be made to it.

    Parameters
    ----------
    text
        What `parse_xml` has accepted.
    """

    def __init__(self, text: str) -> None:
        self._text = text
        self._edits: list[tuple[int, int, str]] = []
        self.root = self._read()

    def _read(self) -> Node:
        top = Node("", 0, 0)
        path = [top]
        line, counted = 1, 0
        for token in _TOKEN.finditer(self._text):
            tag = token["tag"]
            if tag is None:
                continue
            line += self._text.count("\n", counted, token.start())
            counted = token.start()
            if token["close"]:
                node = path.pop()
                node.tag_spans.append(token.span("tag"))
            else:
                span = token.span("tag")
                node = Node(tag, line, token.start(), token.end(), tag_spans=[span])
                self._read_attributes(node, *token.span("rest"))
                path[-1].children.append(node)
                if not token["rest"].endswith("/"):
                    path.append(node)
            node.end = token.end()
        return top.children[0]

    def _read_attributes(self, node: Node, begin: int, end: int) -> None:
        for found in _ATTRIBUTE.finditer(self._text, begin, end):
            name = found[1]
            node.attributes[name] = unescape(found[3])
            node.value_spans[name] = found.span(3)
            node.attribute_spans[name] = found.span()

    def source(self, node: Node) -> str:
        """Return the text of an element as it was, on one line and cut if it is long."""
        line = " ".join(self._text[node.begin : node.end].split())
        return line if len(line) <= 80 else f"{line[:77]}..."

    def set_tag(self, node: Node, tag: str) -> None:
        """Give an element another tag."""
        for span in node.tag_spans:
            self._edit(span, tag)

    def set_value(self, node: Node, attribute: str, value: str) -> None:
        """Give an attribute that is there another value."""
        self._edit(node.value_spans[attribute], escape(value, {'"': "&quot;"}))

    def remove_attribute(self, node: Node, attribute: str) -> None:
        """Take an attribute away, with the space before it."""
        begin, end = node.attribute_spans[attribute]
        while self._text[begin - 1].isspace():
            begin -= 1
        self._edit((begin, end), "")

    def remove(self, node: Node) -> None:
        """Take an element away; its line too, if nothing else is on it."""
        start = self._line_start(node)
        rest = _REST_OF_LINE.match(self._text, node.end)
        if rest and not self._text[start : node.begin].strip():
            self._edit((start, rest.end()), "")
        else:
            self._edit((node.begin, node.end), "")

    def replace(self, node: Node, lines: list[str]) -> None:
        """Put lines in the place of an element, indented as it is."""
        self._edit((node.begin, node.end), self._new_line(node).join(lines))

    def insert(self, node: Node, lines: list[str]) -> None:
        """Put lines at the beginning of what is in an element, one step further in."""
        if not lines:
            return
        new_line = self._new_line(node)
        text = "".join(f"{new_line}\t{line}" for line in lines)
        if self._text[node.opened - 2] == "/":  # <tag/>
            text = f">{text}{new_line}</{node.tag}>"
            self._edit((node.opened - 2, node.opened), text)
        else:
            self._edit((node.opened, node.opened), text)

    def _new_line(self, node: Node) -> str:
        before = self._text[self._line_start(node) : node.begin]
        indent = before[: len(before) - len(before.lstrip())]
        return ("\r\n" if "\r\n" in self._text else "\n") + indent

    def _line_start(self, node: Node) -> int:
        return self._text.rfind("\n", 0, node.begin) + 1

    def _edit(self, span: Span, text: str) -> None:
        self._edits.append((*span, text))

    def result(self) -> str:
        """Return the text with all changes; none may lie inside of another."""
        parts, done = [], 0
        for begin, end, text in sorted(self._edits, key=lambda edit: edit[:2]):
            parts += [self._text[done:begin], text]
            done = end
        return "".join([*parts, self._text[done:]])
