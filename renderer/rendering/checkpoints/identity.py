"""Identity of a render: scene, options, kernels; checkpoints of another one are refused."""

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
# What must be equal to resume a render with identical bits.

Identity = dict[str, dict[str, str]]

_PACKAGE = Path(__file__).parents[2]
# sources that do not affect the sums
_OF_NO_PICTURE = ("command/", "rendering/picture/", "simple/")
# fields of a plan that give amounts or explanations, and do not change samples
_AMOUNTS = {"spp", "rays", "lines", "no_roulette", "sampler"}


@functools.cache
def made_by() -> dict[str, str]:
    """Return the program and the machine, since the last bits depend on them.

    NumPy and LLVM use different instructions on another processor.
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
    """Return the identity of a render: readable entries, and digests of the rest.

    It excludes what does not change the picture: the number of threads, the accelerator,
    and the number of samples if the first samples do not depend on it.
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
    """Return the first difference of two identities in words; None if they are equal."""
    for name in {**ours["said"], **theirs.get("said", {})}:
        there, here = theirs.get("said", {}).get(name), ours["said"].get(name)
        if there != here:
            return f"{name} is {there or 'not said'} there and {here or 'not said'} here"
    for name, digest in ours["hashed"].items():
        if theirs.get("hashed", {}).get(name) != digest:
            return f"{name} there and here are not the same"
    return None


# ------------------------------------------------------------------------------ content
# A digest of the contents of a scene's records, independent of their source.
#
# Files are not hashed: a comment in the XML changes nothing, and a dictionary has no file.

# attributes about the source, which no kernel reads
_NO_CONTENT = {"location", "source", "files", "warnings", "simplified", "id"}


def content_digest(*values: Any) -> str:
    """Return equal hexadecimal digits for equal records, arrays, numbers and texts.

    Raises
    ------
    TypeError
        For any other kind of value.
    """
    return _Digester().digest(values).hex()


class _Digester:
    def __init__(self) -> None:
        self._known: dict[int, bytes] = {}  # by id(): many shapes share a texture

    def digest(self, value: Any) -> bytes:
        """Return a digest of fixed length, so that digests of parts can be concatenated."""
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
        if isinstance(record, OtherBsdf):  # include a user's kernels
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
