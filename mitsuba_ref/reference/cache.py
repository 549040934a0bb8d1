"""Mitsuba's pictures, kept outside the repository and found again by what made them.

The name of an entry is a hash of everything that decides its content: the bytes of the
scene and of each file that it names, the parameters, the versions of Mitsuba and Dr.Jit and
our own code on their side. Nothing is ever out of date; a damaged entry is rendered anew.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

# Mitsuba's process imports this too, so Numba is left to the functions that it never calls.
from mitsuba_ref.records.json_files import from_json, to_json
from mitsuba_ref.records.request import RenderRequest
from mitsuba_ref.reference.errors import MitsubaError
from mitsuba_ref.reference.render import Reference
from mitsuba_ref.reference.variant import drjit_version
from renderer.mitsuba_version import installed_version
from renderer.process.cache_folder import cache_folder
from renderer.process.whole_file import whole_file, why_not_writable
from renderer.scene_file.description import AOV_KINDS

# Code that decides what Mitsuba renders: an edit makes older entries unreachable.
SOURCES = (
    "edited_scene.py",
    "plugins/known_faults.py",
    "plugins/merl.py",
    "render.py",
    "user_plugins.py",
    "variant.py",
    "plugins/whitted.py",
)

RenderFunction = Callable[[RenderRequest, Path], None]
"""Renders a request and writes the entry to the path (see `write_entry`)."""


class ReferenceCache:
    """A folder of rendered references.

    Parameters
    ----------
    render
        Called on a miss with the request and the file to write.
    folder
        Where entries live; default `references` in lightproof's cache.
    """

    def __init__(self, render: RenderFunction, folder: Path | None = None) -> None:
        self._render = render
        self.folder = folder or cache_folder("references")

    def get(self, request: RenderRequest, files: Sequence[str | Path]) -> Reference:
        """Return the reference for `request`, rendered now if there is no sound entry.

        Parameters
        ----------
        request
            What to render.
        files
            Every file that the scene reads, itself among them.

        Raises
        ------
        MitsubaError
            When Mitsuba cannot render it; nothing is stored then.
        """
        path = self.folder / f"{entry_name(request, files)}.npz"
        found = read_entry(path)
        if found is not None:
            return replace(found, from_cache=True)
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
        if why_not_writable(path) is not None:
            return self.render_uncached(request)
        try:
            self._render(request, path)
        except MitsubaError as error:
            if "Error: [Errno" not in str(error):  # a full disk: of the cache, mostly
                raise
            return self.render_uncached(request)
        return read_entry(path) or self.render_uncached(request)

    def render_uncached(self, request: RenderRequest) -> Reference:
        """Render now and keep nothing: to measure time, or where nothing can be kept."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "entry.npz"
            self._render(request, path)
            rendered = read_entry(path)
        if rendered is None:
            raise MitsubaError(f"Mitsuba's picture of {request.path} is not readable")
        return rendered


def entry_name(request: RenderRequest, files: Sequence[str | Path]) -> str:
    """Return the hash that names the entry of `request`; threads change no picture."""
    from renderer.kernels.jit import with_neighbours
    from renderer.replay.camera import ENTRIES

    digest = hashlib.sha256()
    # Of the paths only the file names count: a clone elsewhere finds the same entry.
    wanted = {**asdict(request), "path": Path(request.path).name}
    del wanted["threads"], wanted["plugins"], wanted["allow_outside"]
    digest.update(json.dumps(wanted, sort_keys=True).encode())
    contents = (*AOV_KINDS, str(ENTRIES))
    for made_by in (installed_version(), drjit_version(), *contents):
        digest.update(f"\0{made_by}\0".encode())
    here = Path(__file__).parent
    plugins = with_neighbours(request.plugins) if request.plugins else []
    named = sorted({Path(file).resolve() for file in (request.path, *files)} | {*plugins})
    for file in [here / source for source in SOURCES] + named:
        digest.update(f"\0{file.name}\0".encode())
        try:
            digest.update(file.read_bytes())
        except OSError as error:
            raise MitsubaError(f"{file}: cannot be read: {error.strerror}") from None
    return digest.hexdigest()[:32]


@dataclass(frozen=True)
class EntryFacts:
    """What an entry holds in addition to its arrays; see `Reference`."""

    seconds: float
    threads: int
    spp: int
    integrator: str
    changes: tuple[str, ...]


def write_entry(reference: Reference, path: Path) -> None:
    """Write an entry under another name, then move it: there is no half-written entry."""
    facts = EntryFacts(
        reference.seconds,
        reference.threads,
        reference.spp,
        reference.integrator,
        reference.changes,
    )
    entry: dict[str, Any] = {"facts": np.array(to_json(facts).decode())}
    for name, array in reference.arrays.items():
        entry[f"array_{name}"] = array
    with whole_file(path) as stream:
        np.savez(stream, **entry)


def read_entry(path: Path) -> Reference | None:
    """Return a stored reference, or None if it is missing or damaged."""
    try:
        # Opened here, because NumPy leaves a damaged file open.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as entry:
            facts = from_json(str(entry["facts"]), EntryFacts)
            arrays = {
                name.removeprefix("array_"): entry[name]
                for name in entry.files
                if name != "facts"
            }
        return Reference(arrays=arrays, **vars(facts))
    except Exception:  # missing, or damaged in any way: it is rendered again
        return None
