"""Records as JSON: strict to read, written in one step, without NaN."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np

from renderer.process.whole_file import write_whole

Record = TypeVar("Record")


class RecordError(ValueError):
    """A JSON text is not the record that it should be: one line, with the place."""


def to_json(record: object) -> bytes:
    """Return a dataclass as indented JSON, field by field.

    JSON has no NaN and no infinity: such a number becomes null.
    """
    compact = msgspec.json.encode(record, enc_hook=_plain)
    return msgspec.json.format(compact, indent=1) + b"\n"


def from_json(text: str | bytes, kind: type[Record]) -> Record:
    """Return the dataclass that a JSON text describes.

    Parameters
    ----------
    text
        JSON; keys that the record does not have are passed over.
    kind
        The record. Types are strict: "1" is no number.

    Raises
    ------
    RecordError
        What was expected, what came, and at which place.
    """
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise RecordError(str(error)) from None


def write_json(record: object, path: Path) -> None:
    """Write a record; a reader never sees half of it."""
    write_atomically(path, to_json(record))


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; its folders are made if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)


def _plain(value: Any) -> Any:
    """Return what JSON has for a value of NumPy."""
    if isinstance(value, np.generic):
        return value.item()
    raise NotImplementedError
