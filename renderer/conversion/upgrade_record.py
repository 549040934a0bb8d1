"""What the upgrade of an old scene does to its text, each change with its line."""

from __future__ import annotations

from typing import NamedTuple

from renderer.conversion.xml_edits import EditedXml, Node

CHANGED, APPROXIMATED, DROPPED, LEFT = "changed", "approximated", "dropped", "left"


class Change(NamedTuple):
    """What was done at a line, or why nothing was."""

    line: int
    kind: str  # CHANGED, APPROXIMATED, DROPPED or LEFT
    before: str
    after: str  # empty where something was dropped or left
    why: str = ""

    def __str__(self) -> str:
        """Return `12: changed maxDepth -> max_depth`."""
        text = f"{self.line}: {self.kind} {self.before}"
        text += f" -> {self.after}" if self.after else ""
        return f"{text} ({self.why})" if self.why else text


class UpgradeRecord:
    """A document on its way, and all that was changed in it.

    Parameters
    ----------
    document
        Gets the changes.
    source
        Its path, for messages.
    """

    def __init__(self, document: EditedXml, source: str) -> None:
        self.document, self.source = document, source
        self.changes: list[Change] = []

    def set_value(self, node: Node, attribute: str, new: str, difference: str = "") -> None:
        """Give an attribute another value; with a difference it is approximated."""
        old = node.attributes[attribute]
        self.document.set_value(node, attribute, new)
        kind = APPROXIMATED if difference else CHANGED
        self.add(node, kind, f'<{node.tag} {attribute}="{old}">', f'"{new}"', difference)

    def change(self, node: Node, before: str, after: str) -> None:
        """Note what was replaced without a difference."""
        self.add(node, CHANGED, before, after)

    def drop(self, node: Node, why: str) -> None:
        """Take an element away."""
        before = self.document.source(node)
        self.document.remove(node)
        self.add(node, DROPPED, before, "", why)

    def leave(self, node: Node, what: str, why: str) -> None:
        """Note what stays as it is, and why."""
        self.add(node, LEFT, what, "", why)

    def add(self, node: Node, kind: str, before: str, after: str, why: str = "") -> None:
        """Note a change at the line of an element."""
        self.changes.append(Change(node.line, kind, before, after, why))
