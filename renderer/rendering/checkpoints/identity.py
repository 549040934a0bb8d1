"""What a render must have in common with a checkpoint to go on from it to the same bits."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import platform
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np

from renderer.accelerators.choice import choose_structures
from renderer.process.version import VERSION
from renderer.rendering.checkpoints.content import content_digest
from renderer.rendering.goal import OPEN_ENDED
from renderer.rendering.options import RenderOptions
from renderer.rendering.planning.plan import Plan
from renderer.scene.scene import Scene
from renderer.scene_file.description import Sampler

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
