"""Typed access to one JSON object: a wrong type is one line that names the place."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reports.errors import ReportError


def load_json(path: Path) -> JsonFields:
    """Read a JSON file whose top is an object; NaN and Infinity are not JSON.

    Raises
    ------
    ReportError
        If the file is missing, is not JSON, or holds a non-finite number.
    """

    def refuse(constant: str) -> float:
        raise ReportError(f"{path}: found {constant}; numbers are finite or null")

    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)
    except OSError as error:
        raise ReportError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ReportError(f"{path}: not UTF-8 text; expected JSON") from None
    except json.JSONDecodeError as error:
        raise ReportError(f"{path}:{error.lineno}: not JSON: {error.msg}") from None
    return JsonFields(data, str(path))


class JsonFields:
    """One JSON object and where it stands; absent and null are the same thing."""

    def __init__(self, data: Any, where: str) -> None:
        if not isinstance(data, dict):
            raise ReportError(f"{where}: expected an object, found {_kind(data)}")
        self.data: dict[str, Any] = data
        self.where = where

    def text(self, key: str, default: str | None = None) -> str:
        """Return a string; without a default it must be there."""
        return str(self._get(key, str, "a string", default))

    def integer(self, key: str, default: int | None = None) -> int:
        """Return an integer; without a default it must be there."""
        return int(self._get(key, int, "an integer", default))

    def flag(self, key: str) -> bool | None:
        """Return true, false, or None for null."""
        value = self.data.get(key)
        return None if value is None else bool(self._get(key, bool, "true or false", None))

    def number(self, key: str) -> float | None:
        """Return a finite number, or None for null."""
        value = self.data.get(key)
        if value is None:
            return None
        return float(self._get(key, (int, float), "a number", None))

    def texts(self, key: str) -> tuple[str, ...]:
        """Return a list of strings; absent is empty."""
        values = self._get(key, list, "a list", [])
        for value in values:
            if not isinstance(value, str):
                raise self._mismatch(key, "strings", value)
        return tuple(values)

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return a list of finite numbers; absent is empty."""
        values = self._get(key, list, "a list", [])
        for value in values:
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise self._mismatch(key, "numbers", value)
        return tuple(map(float, values))

    def object(self, key: str) -> JsonFields:
        """Return a nested object; absent is empty."""
        value = self.data.get(key)
        return JsonFields({} if value is None else value, self._at(key))

    def objects(self, key: str) -> Iterator[JsonFields]:
        """Yield the objects of a list; absent is empty."""
        for index, value in enumerate(self._get(key, list, "a list", [])):
            yield JsonFields(value, f"{self._at(key)}[{index}]")

    def named_objects(self, key: str) -> Iterator[tuple[str, JsonFields]]:
        """Yield (name, object) of an object of objects, in the order of the file."""
        table = self.object(key)
        for name in table.data:
            yield name, table.object(name)

    def strings(self, key: str) -> dict[str, str]:
        """Return an object of scalars as strings, in the order of the file."""
        table = self.object(key).data
        return {name: str(value) for name, value in table.items() if value is not None}

    def _get(self, key: str, kind: Any, called: str, default: Any) -> Any:
        value = self.data.get(key)
        if value is None:
            if default is None:
                raise ReportError(f"{self._at(key)}: expected {called}, found nothing")
            return default
        # bool is an int in Python, but true is no sample count.
        if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
            raise self._mismatch(key, called, value)
        return value

    def _mismatch(self, key: str, expected: str, value: Any) -> ReportError:
        return ReportError(f"{self._at(key)}: expected {expected}, found {_kind(value)}")

    def _at(self, key: str) -> str:
        separator = ": " if self.where.endswith(".json") else "."
        return f"{self.where}{separator}{key}"


def _kind(value: Any) -> str:
    shown = json.dumps(value, default=str)
    return shown if len(shown) <= 40 else shown[:37] + "..."
