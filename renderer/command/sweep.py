"""A sweep: one picture for each number of `--frames`, as names and values that have it.

`--frames 0:240 -D angle={frame*1.5} -o turn_####.exr` is 240 pictures. A record in their
folder says what each was made from, so that `--resume` renders those that are missing.
"""

from __future__ import annotations

import argparse
import ast
import json
import operator
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from renderer.errors import SceneError
from renderer.process.whole_file import write_whole

if TYPE_CHECKING:
    from renderer.scene.scene import Scene

MOST_FRAMES = 1_000_000
_FIELD = re.compile(r"\{([^{}]*)\}")
_NUMBER = re.compile(r"\{frame(?::(0?\d{0,3}))?\}")
_POSSIBLE = "possible are numbers, frame, + - * / // % and ()"
_HASHES = re.compile(r"#+")
_OPERATORS: dict[type[ast.AST], Callable[..., float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.USub: operator.neg,
}


def parse_frames(text: str) -> range:
    """Return the frames of `FIRST:END` or `FIRST:END:STEP`; as in Python without `END`.

    Raises
    ------
    ValueError
        Saying what is possible.
    """
    parts = text.split(":")
    try:
        numbers = [int(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3) or 0 in numbers[2:]:
        raise ValueError(f"{text!r} is not of the form FIRST:END or FIRST:END:STEP")
    frames = range(*numbers)
    if not 0 < len(frames) <= MOST_FRAMES:
        raise ValueError(
            f"{text!r} is {len(frames)} frames; 1 to {MOST_FRAMES} are possible"
        )
    return frames


def value_of_frame(text: str, frame: int) -> str:
    """Return a value with its fields computed, such as `{frame}` or `{360*frame/240}`.

    Raises
    ------
    SceneError
        For what is no arithmetic on numbers and `frame`.
    """
    return _FIELD.sub(lambda field: _computed(field[1], frame), text)


def path_of_frame(path: Path, frame: int) -> Path:
    """Return a file's name with the number in the place of `####` or `{frame}`.

    As many digits as there are `#`, at least; `{frame:04}` has four.

    Raises
    ------
    SceneError
        If the name has no such place, so that pictures would overwrite each other.
    """
    name = _HASHES.sub(lambda hashes: f"{frame:0{len(hashes[0])}}", path.name)
    name = _NUMBER.sub(lambda place: f"{frame:{place[1] or ''}}", name)
    if "{" in name or "}" in name:
        raise SceneError(
            f"{path}: possible places for a number are ####, {{frame}} and {{frame:04}}"
        )
    if name == path.name:
        raise SceneError(
            f"{path}: all frames would have one name; possible is "
            f"{path.stem}_####{path.suffix}"
        )
    return path.with_name(name)


def _computed(formula: str, frame: int) -> str:
    try:
        value = _shown(_evaluate(ast.parse(formula.strip(), mode="eval").body, frame))
    except SyntaxError:
        raise SceneError(f"{{{formula}}}: is no formula; {_POSSIBLE}") from None
    except (RecursionError, MemoryError):  # of the parser, or of ours
        raise SceneError(f"a formula of {len(formula)} characters; {_POSSIBLE}") from None
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise SceneError(f"{{{formula}}}: {error}; {_POSSIBLE}") from None
    return value


def _evaluate(node: ast.AST, frame: int) -> float:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    if isinstance(node, ast.Name) and node.id == "frame":
        return frame
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
        sides = [node.operand] if isinstance(node, ast.UnaryOp) else [node.left, node.right]
        return _OPERATORS[type(node.op)](*(_evaluate(side, frame) for side in sides))
    raise ValueError(f"{ast.unparse(node)!r} is no number")


def _shown(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else repr(value)


class SweepRecord:
    """Which frames are finished, and what they were made from: JSON in their folder.

    Parameters
    ----------
    output : Path
        With the place for the number still in it.
    """

    def __init__(self, output: Path) -> None:
        name = re.sub(r"[{}:]", "", output.stem)
        self.path = output.with_name(f"{name}.frames.json")
        self._made_from: dict[str, str] = {}

    def read(self) -> None:
        """Take what an earlier run has left; what cannot be read counts as nothing."""
        try:
            found = json.loads(self.path.read_text(encoding="utf-8"))["frames"]
            self._made_from = {str(name): str(key) for name, key in found.items()}
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            self._made_from = {}

    def has(self, outputs: list[Path], key: str) -> bool:
        """Return whether files are there that were made from the same, and whole."""
        return all(
            self._made_from.get(path.name) == key and path.is_file() for path in outputs
        )

    def add(self, outputs: list[Path], key: str) -> None:
        """Note that pictures are finished.

        Raises
        ------
        SceneError
            If the record cannot be written.
        """
        self._made_from.update({path.name: key for path in outputs})
        self._save()

    def remove(self, outputs: list[Path]) -> None:
        """Forget pictures that are about to be written anew, perhaps not to the end.

        Raises
        ------
        SceneError
            As `add`.
        """
        names = [path.name for path in outputs if path.name in self._made_from]
        for name in names:
            del self._made_from[name]
        if names:
            self._save()

    def _save(self) -> None:
        text = json.dumps({"frames": self._made_from}, indent=1)
        try:
            write_whole(self.path, text.encode())
        except OSError as error:
            reason = error.strerror or error
            raise SceneError(f"{self.path}: cannot be written: {reason}") from error


def of_frame(options: argparse.Namespace, frame: int) -> argparse.Namespace:
    """Return the command's options for one frame."""
    values = vars(options) | {
        "define": [(name, value_of_frame(text, frame)) for name, text in options.define],
        "output": [path_of_frame(path, frame) for path in options.output],
    }
    return argparse.Namespace(**values)


def made_from(scene: Scene, command: str) -> str:
    """Return a digest of all that a picture depends on."""
    from renderer.rendering.checkpoints.identity import content_digest, made_by

    return content_digest(scene.description, made_by(), command)
