"""What a checkpoint belongs to (scene, options, kernels), and a hash of it."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import platform
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np

from renderer.accelerators.choice import choose_structures
from renderer.plugins.bsdfs.registry import kind_of
from renderer.process.names import VERSION
from renderer.rendering.goal import OPEN_ENDED
from renderer.rendering.planning.plan import Plan
from renderer.rendering.render_options import RenderOptions
from renderer.scene.scene import Scene
from renderer.scene_file.description import OtherBsdf, Sampler

# ----------------------------------------------------------------------------- identity
# What a render must have in common with a checkpoint to go on from it to the same bits.

Identity = dict[str, dict[str, str]]

_PACKAGE = Path(__file__).parents[2]
# sources that touch no sum
_OF_NO_PICTURE = ("command/", "rendering/picture/", "simple/")
# fields of a plan that say how much is done, or why, and not what
_AMOUNTS = {"spp", "rays", "lines", "no_roulette", "sampler"}


@functools.cache
def made_by() -> dict[str, str]:
    """Return the program and the machine, on which last bits depend.

    NumPy and LLVM take other instructions on another processor.
    """
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.rglob("*.py")):
        name = source.relative_to(_PACKAGE).as_posix()
        if not name.startswith(_OF_NO_PICTURE):
            digest.update(f"{name}\n".encode() + source.read_bytes())
    features = llvmlite.binding.get_host_cpu_features().flatten()
    processor = llvmlite.binding.get_host_cpu_name()
    return {
        "lightproof": f"{VERSION} ({digest.hexdigest()[:12]})",
        "Python": " ".join((platform.python_version(), *platform.libc_ver())).strip(),
        "NumPy": np.__version__,
        "Numba": f"{numba.__version__} with llvmlite {llvmlite.__version__}",
        "processor": f"{processor} ({content_digest(features)[:12]})",
    }


def identity_of(scene: Scene, plan: Plan, options: RenderOptions) -> Identity:
    """Return what a render is of: what can be said in words, and digests of the rest.

    Not in it is what the picture does not depend on: the threads, the structure that finds
    hits, and the number of samples, if the first ones do not depend on how many follow.
    """
    description = scene.description
    camera, film = description.camera, description.camera.film
    said = made_by() | {
        "integrator": plan.name,
        "sampler": plan.sampler_name,
        "size": f"{film.crop_width} x {film.crop_height}",
    }
    for name, value in options.only("identity").items():
        said[name] = str(value if np.ndim(value) == 0 else list(map(float, value)))
    if plan.sampler.name not in OPEN_ENDED:
        said[f"spp (the points of {plan.sampler.name} depend on it)"] = str(plan.spp)
    if plan.kind.counts_work:
        chosen = choose_structures(scene, options.accelerator, plan.rays)
        said["accel"] = ", ".join(f"{kind} {chosen[kind].name}" for kind in chosen)
    steering: dict[str, Any] = {
        field.name: getattr(plan, field.name)
        for field in dataclasses.fields(plan)
        if field.name not in _AMOUNTS
    }
    steering["sampler"] = dataclasses.replace(plan.sampler, sample_count=0)
    hashed = {
        "camera": content_digest(dataclasses.replace(camera, sampler=Sampler())),
        "shapes (with meshes, BSDFs and textures)": content_digest(
            description.shapes, description.groups, description.instances
        ),
        "lights": content_digest(description.emitters, description.emitter_places),
        "integrator": content_digest(description.integrator),
        "plan": content_digest(steering),
    }
    return {"said": said, "hashed": hashed}


def difference(theirs: Identity, ours: Identity) -> str | None:
    """Return in which way two identities differ first, in words; None if they do not."""
    for name in {**ours["said"], **theirs.get("said", {})}:
        there, here = theirs.get("said", {}).get(name), ours["said"].get(name)
        if there != here:
            return f"{name} is {there or 'not said'} there and {here or 'not said'} here"
    for name, digest in ours["hashed"].items():
        if theirs.get("hashed", {}).get(name) != digest:
            return f"{name} there and here are not the same"
    return None


# ------------------------------------------------------------------------------ content
# A digest of what a scene's records hold, wherever they were read from.
#
# Not of the files: a comment in the XML changes nothing, and a dictionary has none.

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
