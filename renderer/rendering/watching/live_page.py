"""`--view`: a page in the browser that shows a picture during its render.

The server listens on 127.0.0.1 only. Other programs on the machine, such as a page of
another site in the same browser, lack the random token of the address. A request must also
name this server as its host, so that a foreign host name that resolves to 127.0.0.1 (DNS
rebinding) is refused. All other requests are answered by 404.

The page polls the state. The answer comes after a quarter of a second, or earlier with a
new picture, which the page then requests. Without a page no picture is developed. The
server delays the answers; the page does not delay its requests, since browsers slow down
the timers of pages in the background.
"""

from __future__ import annotations

import hmac
import json
import secrets
import threading
import time
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.rendering.picture.picture import Picture
from renderer.rendering.progress_display import Progress, time_left

PAGE = Path(__file__).with_name("page.html")
HOST = "127.0.0.1"
EVERY = 0.25  # [s] minimum interval between two pictures
SHARE = 0.05  # maximum fraction of the render time spent on pictures
LOOKS_FOR = 3.0  # [s] after its last request a page counts as closed
PATIENCE = 10.0  # [s] to wait for a page to fetch the finished picture
BRIEF = 1.0  # [s] to wait after Ctrl-C
_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",  # the address contains the token
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; connect-src 'self'; img-src data:; frame-ancestors 'none'",
}


class Layer(NamedTuple):
    """The picture, or an AOV."""

    name: str
    kind: str  # "color", or the kind of the AOV
    values: NDArray[np.float32]  # (height, width, channels)


class Snapshot(NamedTuple):
    """The state that the page requests; replaced as a whole, never changed."""

    version: int
    layers: tuple[Layer, ...]


class LivePage:
    """Page that shows each `Progress` that the object is called with; a context manager.

    Parameters
    ----------
    title
        Title of the page, such as the name of the scene.

    Attributes
    ----------
    address : str
        Address of the page, with the token.

    Raises
    ------
    SceneError
        If no port is available.
    """

    def __init__(self, title: str = "") -> None:
        self._token = secrets.token_urlsafe(16)
        self._snapshot = Snapshot(0, ())
        self._shape: tuple[int, ...] = ()  # of the picture
        self._state: dict[str, Any] = {"stage": "start"}
        self._title = title
        self._last_look = float("-inf")
        self._news = threading.Event()
        self._had = 0  # the last version that a page has received
        self._delivered = threading.Event()  # a page has the whole finished picture
        self._over = False
        self._next_picture = 0.0
        try:
            self._server = ThreadingHTTPServer((HOST, 0), _handler(self))
        except OSError as error:
            reason = error.strerror or error
            raise SceneError(f"no page can be served at {HOST}: {reason}") from None
        self._server.daemon_threads = True
        self._hosts = {f"{name}:{self.port}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{self.port}/{self._token}/"

    @property
    def port(self) -> int:
        """Port number, chosen by the operating system."""
        return int(self._server.server_address[1])

    def __enter__(self) -> Self:
        """Start the server."""
        threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True
        ).start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the port."""
        self._server.shutdown()
        self._server.server_close()

    # ------------------------------------------------------------- from the render

    def __call__(self, now: Progress) -> None:
        """Send the progress to the page; develop the picture if a page waits for it."""
        self._state = {
            "stage": now.stage,
            "done": now.done,
            "total": now.total,
            "seconds": now.seconds,
            "left": time_left(now),
            "error": now.error if now.error not in (None, float("inf")) else None,
            "note": now.cluster,
        }
        start = time.monotonic()
        if now.picture is None or start < self._next_picture or not self._is_waited_for():
            return
        shown = now.picture()
        self._put(shown.pixels, shown.aovs, shown.aov_kinds)
        took = time.monotonic() - start
        self._next_picture = start + max(EVERY, took / SHARE)

    def end(self, image: Picture, patience: float = PATIENCE) -> None:
        """Show the finished picture, and wait until a page has all of it.

        Parameters
        ----------
        image
            The result of `render`.
        patience
            Seconds to wait for a page that has not been opened yet, or for an open page to
            fetch the picture.
        """
        self._state |= {
            "stage": "finished" if image.complete else "interrupted",
            "seconds": image.seconds,
            "error": image.error,
            "note": "denoised" if "denoised" in image.metadata else "",
            "samples": image.samples_text,
        }
        self._put(image.pixels, image.aovs, image.aov_kinds)
        self._over = True  # set after the picture: the page fetches all its layers
        self._news.set()
        if self.is_watched or not self.was_opened:
            self._delivered.wait(patience if image.complete else min(patience, BRIEF))

    @property
    def is_watched(self) -> bool:
        """Whether a page is open."""
        return time.monotonic() - self._last_look < LOOKS_FOR

    @property
    def was_opened(self) -> bool:
        """Whether a page has been open at any time."""
        return self._last_look > float("-inf")

    def _is_waited_for(self) -> bool:
        return self.is_watched and self._had == self._snapshot.version

    def _put(self, pixels: Any, aovs: Any, kinds: Any) -> None:
        layers = [(name, kinds.get(name, ""), values) for name, values in aovs.items()]
        if not layers or pixels.any():  # black while the AOVs of a render are in progress
            layers.insert(0, ("picture", "color", pixels))
        new = {
            name: Layer(name, kind, np.array(values, np.float32))
            for name, kind, values in layers
        }
        # AOVs are rendered before the colours, and are kept
        old = self._snapshot.layers if pixels.shape == self._shape else ()
        kept = {layer.name: layer for layer in old}
        self._shape = pixels.shape
        found = tuple((new | kept | new).values())
        self._snapshot = Snapshot(self._snapshot.version + 1, found)
        self._news.set()

    # --------------------------------------------------------------- to the page

    def answer(self, host: str, path: str) -> tuple[str, bytes] | None:
        """Return type and content of the answer to a request; None for 404."""
        begin = f"/{self._token}/"
        path = urlsplit(path).path
        right = hmac.compare_digest(path[: len(begin)].encode(), begin.encode())
        if host not in self._hosts or not right:
            return None
        snapshot = self._snapshot
        match path[len(begin) :].split("/"):
            case [""]:
                return "text/html; charset=utf-8", PAGE.read_bytes()
            case ["state"]:
                self._last_look = time.monotonic()
                self._news.wait(EVERY)
                self._news.clear()
                return "application/json", json.dumps(self._told()).encode()
            case ["layer", version, number] if version == str(snapshot.version):
                if not number.isdecimal() or int(number) >= len(snapshot.layers):
                    return None
                values = snapshot.layers[int(number)].values
                return "application/octet-stream", values.astype("<f4").tobytes()
            case ["have", version] if version == str(snapshot.version):
                # the page has its displayed layer of this version, or all of the finished
                # one
                self._had = snapshot.version
                if self._over:
                    self._delivered.set()
                return "text/plain", b""
        return None

    def _told(self) -> dict[str, Any]:
        over, snapshot = self._over, self._snapshot  # read in this order: see `end`
        shapes = [
            {"name": layer.name, "kind": layer.kind, "shape": layer.values.shape}
            for layer in snapshot.layers
        ]
        known = {"title": self._title, "version": snapshot.version, "over": over}
        return self._state | known | {"layers": shapes}


def _handler(page: LivePage) -> type[BaseHTTPRequestHandler]:
    """Return the request handler class for a page."""

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 20.0  # [s] so that no thread waits forever for a silent connection

        def do_GET(self) -> None:
            # a browser may close the page during an answer
            with suppress(ConnectionError):
                self._send()

        def _send(self) -> None:
            found = page.answer(self.headers.get("Host", ""), self.path)
            kind, content = found or ("text/plain", b"")
            self.send_response_only(200 if found else 404)
            headers = _HEADERS | {"Content-Type": kind, "Content-Length": str(len(content))}
            for name, value in headers.items():
                self.send_header(name, value)
            self.end_headers()
            self.wfile.write(content)

        def send_error(self, *_: Any, **__: Any) -> None:
            """Answer other methods and invalid requests by 404."""
            self.send_response_only(404)
            self.send_header("Content-Length", "0")
            self.send_header("Connection", "close")
            self.end_headers()

        def log_message(self, format: str, *arguments: Any) -> None:
            """Do nothing: standard error shows the progress."""

    return Handler
