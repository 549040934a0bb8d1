"""Two renderers that do not render: each does what the "scene file" tells it to.

The file is JSON, {"ours": BEHAVIOUR, "mitsuba": BEHAVIOUR}. "fine" hands over a picture
that passes, so that a test sees the one thing that it broke. Run as a module it is the
process in which the harness believes Mitsuba to be.
"""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np

from mitsuba_ref.our_renderer.picture import OurPicture
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.cache import write_entry
from mitsuba_ref.reference.edited_scene import BOX_INSTEAD
from mitsuba_ref.reference.errors import MitsubaRefused
from mitsuba_ref.reference.json_process import Answerer, answer_requests
from mitsuba_ref.reference.render import Reference
from renderer.errors import SceneError

HEIGHT, WIDTH = 18, 24
CHANNELS = {
    "depth": 1, "position": 3, "geo_normal": 3, "sh_normal": 3, "uv": 2, "albedo": 3,
    "shape_index": 1, "prim_index": 1,
}  # fmt: skip


def picture(seed: int, spp: int | None = None) -> np.ndarray:
    """A grey wall with the noise of a few samples, or of `spp`."""
    noise = np.random.default_rng(seed).standard_normal((HEIGHT, WIDTH, 3))
    return (0.5 + 0.05 * noise / np.sqrt(spp or 1)).astype(np.float32)


def wall() -> dict[str, np.ndarray]:
    """The AOVs of a flat wall that fills the picture."""
    arrays = {kind: np.ones((HEIGHT, WIDTH, n)) for kind, n in CHANNELS.items()}
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] / WIDTH
    arrays["position"][..., 0], arrays["position"][..., 1] = columns, rows
    arrays["uv"] = np.stack([columns, rows], axis=-1)
    return {kind: array.astype(np.float32) for kind, array in arrays.items()}


def spoil(array: np.ndarray, how: str) -> np.ndarray:
    """Return the array as `how` says; "fine" leaves it alone."""
    if how in ("nan", "inf"):
        array = array.copy()
        array[3, 4, 0] = float(how)
    shapes = {
        "empty": array[:0],
        "narrow": array[:, :-1],
        "one pixel": array[:1, :1],
        "one channel": array[..., :1],
        "four channels": np.concatenate([array, array[..., :1]], axis=-1),
        "no channels": array[..., 0],
    }
    return shapes.get(how, array)


def arrays_of(request: RenderRequest, how: str) -> dict[str, np.ndarray]:
    """Return what the behaviour makes of a request."""
    if request.kind == "aovs":
        return {
            kind: spoil(array, how.partition("aov ")[2] if kind == "depth" else "")
            for kind, array in wall().items()
        }
    return {"pixels": spoil(picture(request.seed, request.spp), how)}


def behaviour(request: RenderRequest, side: str) -> str:
    """Return what the file says of a side; some behaviours wait for their occasion."""
    how = str(json.loads(Path(request.path).read_text())[side])
    if how.startswith("own filter "):
        return "" if request.box_filter else how.removeprefix("own filter ")
    if how.startswith("later "):  # than the pictures that are compared without a ladder
        # here, as the process that stands for Mitsuba's would import SciPy with it
        from mitsuba_ref.ladder.pictures_by_seed import FIRST_REFERENCE_SEED, SEED_STEP

        seed, theirs = request.seed, request.seed - FIRST_REFERENCE_SEED
        late = (seed if theirs < 0 else theirs // SEED_STEP) >= 5
        return how.removeprefix("later ") if late else ""
    if how.startswith("independent "):
        return how.removeprefix("independent ") if request.independent else ""
    return how


def render_ours(request: RenderRequest) -> OurPicture:
    """Stand in for our renderer."""
    how = behaviour(request, "ours")
    if how == "refuse":
        raise SceneError('scene.xml:7: bsdf "velvet" is not supported; supported: diffuse')
    if how == "bug":
        raise KeyError("spheres")
    if how == "memory":
        raise MemoryError
    files = (request.path,)
    return OurPicture(arrays_of(request, how), spp=4, files=files, integrator="canned")


def render_as_mitsuba(request: RenderRequest) -> Reference:
    """Stand in for Mitsuba, in whatever process this is."""
    how = behaviour(request, "mitsuba")
    if how == "refuse":
        raise MitsubaRefused('[parser.cpp] plugin "velvet" not found')
    if how == "bug":
        raise KeyError("emitters")
    if how == "hang":
        time.sleep(3600)
    if how == "crash":
        os.write(2, b"LLVM ERROR: no such register\n")
        os.kill(os.getpid(), signal.SIGSEGV)
    if how == "leave":
        os._exit(0)
    changes = (BOX_INSTEAD,) if request.box_filter else ()
    return Reference(arrays_of(request, how), 0.1, 2, 4, "canned", changes)


class InProcess:
    """Takes the place of `MitsubaWorker` where no process of its own is needed."""

    def __init__(self, time_limit: float) -> None:
        self.time_limit = time_limit

    def __enter__(self) -> InProcess:
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def render(self, request: RenderRequest, path: Path) -> None:
        write_entry(render_as_mitsuba(request), path)


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Answer as `mitsuba_ref.reference.picture_process` does."""

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        reference = render_as_mitsuba(RenderRequest(**wanted["request"]))
        write_entry(reference, Path(wanted["path"]))
        return {}

    return {}, render


if __name__ == "__main__":
    answer_requests(load)
