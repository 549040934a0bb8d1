"""A digest of what a scene's records hold, wherever they were read from.

Not of the files: a comment in the XML changes nothing, and a dictionary has none.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from renderer.plugins.bsdfs.registry import kind_of
from renderer.scene_file.description import OtherBsdf

# what tells where something comes from, and no kernel sees
_NO_CONTENT = {"location", "source", "files", "warnings", "simplified", "id"}


def content_digest(*values: Any) -> str:
    """Return the same hexadecimal digits for equal records, arrays, numbers and texts.

    Raises
    ------
    TypeError
        For any other kind of value.
    """
    return _Digester().digest(values).hex()


class _Digester:
    def __init__(self) -> None:
        self._known: dict[int, bytes] = {}  # by identity: a texture of many shapes

    def digest(self, value: Any) -> bytes:
        """Return a digest of fixed length, so that those of parts can be joined."""
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, (type(None), bool, int, float, str)):
            return _hash(type(value).__name__.encode(), repr(value).encode())
        if isinstance(value, np.ndarray):
            kind = f"{value.dtype.str} {value.shape}".encode()
            return _hash(kind, np.ascontiguousarray(value).reshape(-1))
        if isinstance(value, (tuple, list)):
            return _hash(b"row", *map(self.digest, value))
        if isinstance(value, Mapping):
            items = sorted(value.items())
            return _hash(b"names", *(self.digest(part) for item in items for part in item))
        if not dataclasses.is_dataclass(value):
            raise TypeError(f"a {type(value).__name__} in a scene has no digest")
        if id(value) not in self._known:
            self._known[id(value)] = self._of_record(value)
        return self._known[id(value)]

    def _of_record(self, record: Any) -> bytes:
        parts = [self.digest(type(record).__name__)]
        if isinstance(record, OtherBsdf):  # its kernels may be the user's own
            parts.append(self.digest(kind_of(record).source))
        for field in dataclasses.fields(record):
            if field.name not in _NO_CONTENT:
                parts.append(self.digest(getattr(record, field.name)))
        return _hash(b"record", *parts)


def _hash(*parts: Any) -> bytes:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.digest()
