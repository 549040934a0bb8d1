"""What bad input raises."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def printable(text: str) -> str:
    """Return text on one line that commands no terminal and can be encoded.

    Damaged files are quoted in messages.
    """
    return "".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text)


class SceneError(ValueError):
    """A scene, or a file it names, cannot be rendered.

    The message is one line: where (file and line), what was found, what is possible.
    """

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


class PluginError(SceneError):
    """A user's file of plugins cannot be used; the message says where, and what helps.

    Parameters
    ----------
    message
        What is wrong, and what is possible.
    place
        "FILE:LINE" in the user's file; empty where it is not known.
    """

    def __init__(self, message: str, place: str = "") -> None:
        self.place = place
        super().__init__(f"{place}: {message}" if place else message)


class CheckpointWarning(RuntimeWarning):
    """A checkpoint cannot be written, is missing, or only the one before is whole."""


class UnsupportedPlugin(SceneError):
    """A scene has a plugin that this renderer has not."""


class MissingFile(SceneError):
    """A scene names a file that is not there."""


class NotReplayable(SceneError):
    """A scene can be rendered, but not with Mitsuba's random numbers in its order."""


class NotAllowed(SceneError):
    """A scene wants what it may not have: a file outside of its folder, or memory.

    No other program is given it then, such as the renderer that ours is compared with.
    """


class ClusterError(RuntimeError):
    """A cluster cannot be reached, or cannot go on with a render; the message is one line.

    What was rendered before is not lost: `render` returns it as after an interrupt.
    """


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return "; did you mean NAME?" for a known name that is like this one, or nothing."""
    found = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {found[0]}?" if found else ""
