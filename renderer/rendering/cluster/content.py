"""A scene and what is to be done with it, as bytes that are known by what they hold.

Workers share no disk with the client. They get the description as it was read, with the
contents of all files in it. Large arrays are pieces of their own, under
a hash of theirs: a sweep of pictures that share a mesh sends it once.

Pickles run code when they are read, here as everywhere in Dask: a cluster is one of
machines that trust each other (docs/cluster.md).
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

LEAST = 1 << 16  # [bytes] of an array that is a piece of its own
Name = tuple[str, bool]  # a hash, and whether the array may be written to


class Content(NamedTuple):
    """A frozen object: its skeleton, and its large arrays."""

    names: tuple[Name, ...]  # of the skeleton, then of the arrays as it needs them
    pieces: Mapping[str, bytes]  # by hash, each once, in the order of the names

    @property
    def key(self) -> str:
        """A hash of all of it."""
        return hashlib.sha256(repr(self.names).encode()).hexdigest()[:32]


def freeze(thing: Any) -> Content:
    """Return an object as bytes.

    Raises
    ------
    TypeError, AttributeError, pickle.PicklingError
        If something in it cannot be sent, such as a function of a prompt.
    """
    arrays: list[tuple[Name, bytes]] = []

    def keep_inside(buffer: pickle.PickleBuffer) -> bool:
        with buffer.raw() as view:
            if view.nbytes < LEAST:
                return True
            held = bytes(view)
            arrays.append(((_hash(held), not view.readonly), held))
        return False

    skeleton = pickle.dumps(thing, protocol=5, buffer_callback=keep_inside)
    parts = [((_hash(skeleton), False), skeleton), *arrays]
    return Content(
        tuple(name for name, _ in parts), {name: held for (name, _), held in parts}
    )


def _hash(held: bytes) -> str:
    return hashlib.sha256(held).hexdigest()[:32]


def thaw(names: Sequence[Name], held: Sequence[bytes]) -> Any:
    """Return the object again; `held` are the pieces, each once.

    Whether an array may be written to is part of its type in compiled code, and what is
    compiled for one is not for the other.
    """
    pieces = dict(zip(dict.fromkeys(name for name, _ in names), held, strict=True))
    (skeleton, _), *arrays = names
    buffers = [bytearray(pieces[n]) if writable else pieces[n] for n, writable in arrays]
    return pickle.loads(pieces[skeleton], buffers=buffers)
