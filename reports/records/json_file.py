"""One JSON file into one record: a mistake is one line with file, place and finding."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from mitsuba_ref.records.json_files import write_atomically
from reports.errors import ReportError

Record = TypeVar("Record")

_STEP = re.compile(r"\.(\w+)|\[(\d+)\]|(\[\.\.\.\])")


def read_json(path: Path, kind: type[Record], schema: int | None = None) -> Record:
    """Decode a file into a dataclass; types are strict, and numbers are finite.

    Parameters
    ----------
    path
        The file.
    kind
        A dataclass; its fields are the keys, those without a default must be there, and
        keys that it lacks are passed over.
    schema
        What the file must say under "schema"; None: it need not say anything.

    Raises
    ------
    ReportError
        One line: what is wrong and where.
    """
    try:
        content = path.read_bytes()
        content.decode()  # JSON is UTF-8, everywhere in the file
    except OSError as error:
        raise ReportError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ReportError(f"{path}: not UTF-8 text; expected JSON") from None
    try:
        if schema is not None:
            found = msgspec.json.decode(content, type=_Head).schema
            if found != schema:
                raise ReportError(
                    f"{path}: schema {found}; this version reads schema {schema}"
                )
        return msgspec.json.decode(content, type=kind)
    except msgspec.ValidationError as error:
        document = json.loads(content)
        place, value = _place(str(error), document, kind)
        what = str(error).partition(" - at ")[0].partition(", got ")[0]
        raise ReportError(
            f"{path}: {place}{what[:1].lower() + what[1:]}, found {_shown(value)}"
        ) from None
    except msgspec.DecodeError as error:
        raise ReportError(f"{path}{_no_json(str(error), content)}") from None


def write_json(path: Path, record: Any, schema: int) -> None:
    """Write a record such that `read_json` reads it again; in one step."""
    content = {"schema": schema, **msgspec.to_builtins(record)}
    text = msgspec.json.format(msgspec.json.encode(content), indent=1)
    write_atomically(path, text + b"\n")


class _Head(msgspec.Struct):
    schema: int


def _place(message: str, document: Any, kind: type) -> tuple[str, Any]:
    """Return the place that msgspec's sentence names, and the value there.

    msgspec writes "[...]" for a key of a dictionary. Which one it is comes out by trying:
    the document that has this key alone is refused just the same.
    """
    told = message.partition(" - at ")[2]
    steps = _STEP.findall(told.partition("$")[2])
    if told.startswith("`key`"):  # it is a key that is wrong, not its value
        steps.append(("", "", "[...]"))
    place, value = "", document
    for name, index, unknown in steps:
        key = _refused_key(message, document, kind, value) if unknown else name or index
        place += f"[{key}]" if index else f".{key}"
        value = value[int(index)] if index else value[key]
    if told.startswith("`key`"):
        value = key
    return (f"{place.lstrip('.')}: " if place else ""), value


def _refused_key(message: str, document: Any, kind: type, table: dict[str, Any]) -> str:
    """Return the key of `table` that is refused; leave `table` with this key alone."""
    whole = dict(table)
    for key, value in whole.items():
        table.clear()
        table[key] = value
        try:
            msgspec.convert(document, kind, str_keys=True)
        except msgspec.ValidationError as error:
            if str(error) == message:
                return key
    table.update(whole)
    return "..."


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _no_json(message: str, content: bytes) -> str:
    """Return ":3: not JSON: invalid character, found NaN" for msgspec's sentence."""
    told = re.search(r"\(byte (\d+)\)", message)
    byte = int(told[1]) if told else len(content)
    line = content.count(b"\n", 0, byte) + 1
    # the whole word that the byte is in
    before = re.search(rb"[\w.+-]*$", content[:byte])
    word = re.match(rb"[\w.+-]*", content[before.start() if before else byte :])
    found = (word and word[0]) or content[byte : byte + 1]
    shown = found[:40].decode(errors="replace")
    reason = message.removeprefix("JSON is malformed: ").partition(" (byte")[0]
    return f":{line}: not JSON: {reason}" + (f", found {shown}" if shown else "")
