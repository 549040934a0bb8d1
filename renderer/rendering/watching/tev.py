"""`--tev`: sends tiles of a picture during its render to a running tev.

tev receives packets (see its `include/tev/Ipc.h`): the length in bytes, including itself
(32 bits), a byte for the type, and the content. Numbers are little endian, strings end with
a zero byte.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.rendering.picture.image_files import exr_planes
from renderer.rendering.picture.picture import Picture
from renderer.rendering.progress_display import Progress

TILE = 64  # [pixels] side of the tiles that are compared and sent
EVERY = 1.0  # [s] minimum interval between two pictures
SHARE = 0.05  # maximum fraction of the render time spent on pictures
TIMEOUT = 5.0  # [s]
_CLOSE, _CREATE, _UPDATE = 2, 4, 6
Planes = dict[str, NDArray[np.float32]]


class Tev:
    """Sends the picture of each `Progress` that it is called with; a context manager.

    Parameters
    ----------
    host, port
        Address of tev.
    name
        Name of the picture in tev's list.

    Raises
    ------
    SceneError
        If the connection fails.
    """

    def __init__(self, host: str, port: int, name: str) -> None:
        self._name = name
        self._sent: Planes = {}
        self._shape: tuple[int, ...] = ()
        self._next = 0.0  # [s] time of the next picture
        self.trouble = ""  # the error after which nothing is sent any more
        try:
            self._socket = socket.create_connection((host, port), timeout=TIMEOUT)
        except OSError as error:
            reason = error.strerror or error
            raise SceneError(f"no tev at {host}:{port}: {reason}; start it first") from None

    def __enter__(self) -> Self:
        """Return the connection."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the connection; tev keeps the picture."""
        self._socket.close()

    def __call__(self, now: Progress) -> None:
        """Send the tiles that have changed, if the time of the next picture has come."""
        start = time.monotonic()
        if self.trouble or now.picture is None or now.done == 0 or start < self._next:
            return
        shown = now.picture()
        self._send(Picture(shown.pixels, shown.aovs, shown.aov_kinds))
        took = time.monotonic() - start
        self._next = start + max(EVERY, took / SHARE)

    def end(self, image: Picture) -> None:
        """Send the tiles in which the finished picture differs from the last one."""
        if not self.trouble:
            self._send(image)

    def _send(self, picture: Picture) -> None:
        planes = exr_planes(picture)
        height, width = shape = picture.pixels.shape[:2]
        try:
            if planes.keys() != self._sent.keys() or self._shape != shape:
                if self._sent:
                    self._packet(_CLOSE, _text(self._name))
                self._create(planes, height, width)
            for x, y in self._changed(planes, height, width):
                self._update(planes, x, y)
        except OSError as error:  # tev was closed: the render goes on
            self.trouble = error.strerror or str(error)
        self._sent, self._shape = planes, shape

    def _changed(
        self, planes: Planes, height: int, width: int
    ) -> Iterator[tuple[int, int]]:
        for y in range(0, height, TILE):
            for x in range(0, width, TILE):
                part = np.s_[y : y + TILE, x : x + TILE]
                if not self._sent or any(
                    not np.array_equal(plane[part], self._sent[name][part], equal_nan=True)
                    for name, plane in planes.items()
                ):
                    yield x, y

    def _create(self, planes: Planes, height: int, width: int) -> None:
        names = b"".join(map(_text, planes))
        size = struct.pack("<iii", width, height, len(planes))
        self._packet(_CREATE, b"\x01" + _text(self._name) + size + names)
        self._sent = {}

    def _update(self, planes: Planes, x: int, y: int) -> None:
        parts = [plane[y : y + TILE, x : x + TILE] for plane in planes.values()]
        height, width = parts[0].shape
        count = len(parts)
        numbers = range(0, count * width * height, width * height)
        self._packet(
            _UPDATE,
            b"\x00"
            + _text(self._name)
            + struct.pack("<i", count)
            + b"".join(map(_text, planes))
            + struct.pack("<iiii", x, y, width, height)
            + struct.pack(f"<{count}q", *numbers)  # offset of each channel
            + struct.pack(f"<{count}q", *[1] * count)  # stride between its pixels
            + np.stack(parts).astype("<f4").tobytes(),
        )

    def _packet(self, kind: int, content: bytes) -> None:
        self._socket.sendall(struct.pack("<IB", len(content) + 5, kind) + content)


def _text(text: Any) -> bytes:
    return str(text).encode() + b"\0"
