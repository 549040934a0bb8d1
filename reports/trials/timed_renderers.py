"""Renderers that are timed: ours in many ways, Mitsuba's variants, other programs.

A contender renders (seed, samples per pixel) into seconds and a picture. Its scene is
loaded when it is made, and it has rendered once, so that nothing compiles when it is timed.
"""

from __future__ import annotations

import functools
import os
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsuba_ref.ladder.pictures_by_seed import SEED_STEP
from mitsuba_ref.reference.errors import MitsubaError, MitsubaTimeout
from mitsuba_ref.reference.json_process import JsonProcess
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from renderer.errors import SceneError
from renderer.process.names import SAMPLERS
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import Scene
from reports.trials.contenders import OURS, Shot, compare_means, mean_of, of_ours
from reports.trials.plain_scenes import write_plain_scene

VARIANTS = ("scalar_rgb", "llvm_ad_rgb")
THEIR_SAMPLERS = ("independent", "stratified", "multijitter", "orthogonal", "ldsampler")
METHODS = ("direct", "path", "whitted")
LONG = "multijitter"  # sampler of references
JUDGES = ("independent", LONG)  # samplers by whose means and references others are judged

# Of ours as well: its rays leave a surface up to 9e-5 (1 + |p|) away and pass over bumps
# that are lower. At the terminators of `ball-and-sun` that lets in 1e-4 of the picture's
# light, in 1000 of 230,400 pixels (16 such pixels of a coarser ball: 1.680 in double
# precision, 1.685 by our own rule, 1.721 by Mitsuba's). Compared with a reference of
# Mitsuba's our own, tighter rule has a relMSE of 6.5e-5 with any number of samples, half
# that of 16.
RAY_OFFSET = "mitsuba"

# Mitsuba 3.9.1's `ldsampler` makes NaN of the scene white-furnace, and never ends a path of
# its seed 4 (16 samples, 48 x 32).
NOT_FINITE = "its picture has values that are not finite"
PATIENCE = 120.0  # [s] for one picture
STARTING = 600.0  # [s] for another program to load a scene and to draw the first picture
# Further programs: the package, and the module that adapts it. A Python that has the
# package is named by LIGHTPROOF_CYCLES_PYTHON or LIGHTPROOF_LUXCORE_PYTHON, as peers need
# other versions of libraries.
OTHERS = {
    "cycles": ("bpy", "reports.trials.cycles_peer"),
    "luxcore": ("pyluxcore", "reports.trials.luxcore_peer"),
}
# Mitsuba 3.9.1's `llvm_ad_rgb` takes 11 to 20 s for each picture of 10,000 instances, also
# for the same one again, and more than a minute where two such scenes are loaded; here one
# is for each sampler.
ANEW = "it goes through all instances anew for each picture"

CHECK_SEEDS, CHECK_SPP = range(12), 4

Contender = Callable[[int, int], Shot]
Show = Callable[[str], None]


@dataclass(frozen=True)
class Settings:
    """How much is measured."""

    spp: Sequence[int] = (4, 16)
    seeds: int = 3  # pictures of each contender at each number of samples
    reference: int = 1024  # samples of the reference, or a few more
    threads: int = 2  # workers of each renderer
    side: int = 320  # [pixels] of the longer side of a picture
    samplers: Sequence[str] = SAMPLERS  # ours


def of_mitsuba(peer: TimedMitsuba, folder: Path, sampler: str | None) -> Contender:
    """Return a variant of Mitsuba with one of its samplers; pictures come as files.

    Its seeds are spread, since pictures of neighbouring ones share random numbers.
    """
    file = folder / "picture.npy"

    def render(seed: int, spp: int) -> Shot:
        seconds = peer.render(SEED_STEP * seed, spp, file, sampler).seconds
        return seconds, np.load(file).astype(np.float64)

    return render


def our_renderers(scene: Scene, settings: Settings, show: Show) -> dict[str, Contender]:
    """Return our samplers, and our other methods where they give the same picture."""
    plan = make_plan(scene)
    named = (*settings.samplers, plan.sampler.name, *JUDGES)
    ways = [(plan.method, sampler) for sampler in dict.fromkeys(named)]
    if plan.max_depth <= 2:  # direct light alone: each method computes the same
        others = (method for method in METHODS if method != plan.method)
        ways += [(method, settings.samplers[0]) for method in others]
    found = {}
    for method, sampler in ways:
        name = f"{OURS} {method}, {sampler}"
        given = {} if method == plan.method else {"integrator": method}
        contender = of_ours(
            scene, settings.threads, sampler=sampler, ray_offset=RAY_OFFSET, **given
        )
        show(f"compiling {name}")
        contender(0, settings.spp[0])
        found[name] = contender
    return found


def mitsuba_renderers(
    stack: ExitStack,
    variant: str,
    path: Path,
    parameters: Mapping[str, str],
    settings: Settings,
    folder: Path,
) -> tuple[dict[str, Contender], dict[str, str]]:
    """Return a variant with each of its samplers, and why some are left out.

    Parameters
    ----------
    stack
        Ends the variant's process.
    folder
        For its pictures.
    """
    program = f"mitsuba {variant}"
    found: dict[str, Contender] = {}
    absent: dict[str, str] = {}
    try:
        with ExitStack() as opened:
            peer = opened.enter_context(
                TimedMitsuba(variant, path, parameters, settings.threads, THEIR_SAMPLERS)
            )
            peer.time_limit = PATIENCE
            for sampler in THEIR_SAMPLERS:
                contender = of_mitsuba(peer, folder, sampler)
                # JIT variants compile for each number of samples
                warm = settings.spp if "_ad_" in variant else settings.spp[:1]
                if all(np.isfinite(contender(0, spp)[1]).all() for spp in warm):
                    found[f"{program}, {sampler}"] = contender
                elif sampler in JUDGES:
                    raise MitsubaError(f"{variant} {sampler}: {NOT_FINITE}")
                else:
                    absent[f"{program}, {sampler}"] = NOT_FINITE
            stack.push(opened.pop_all())
    except MitsubaError as error:
        late = isinstance(error, MitsubaTimeout) and 'type="instance"' in path.read_text()
        return {}, {program: f"{error}: {ANEW}" if late else str(error)}
    return found, absent


def other_renderers(
    stack: ExitStack, program: str, scene: Scene, settings: Settings, folder: Path
) -> tuple[dict[str, Contender], dict[str, str]]:
    """Return one of `OTHERS` with its sampler, or why it cannot draw the scene."""
    package, module = OTHERS[program]
    variable = f"LIGHTPROOF_{program.upper()}_PYTHON"
    file = folder / f"{program}.npy"
    python = os.environ.get(variable, sys.executable)
    if shutil.which(python) is None:
        return {}, {program: f"{variable} names {python}, which is no program"}
    try:
        write_plain_scene(scene.description, folder)
        peer = stack.enter_context(
            JsonProcess(
                module,
                {"folder": str(folder), "threads": settings.threads},
                name=program,
                time_limit=STARTING,
                python=python,
            )
        )

        def render(seed: int, spp: int) -> Shot:
            answer = peer.ask({"seed": seed, "spp": spp, "keep": str(file)})
            return float(answer["seconds"]), np.load(file).astype(np.float64)

        for spp in settings.spp:  # a number may be one that it cannot take
            render(0, spp)
        peer.time_limit = PATIENCE
    except (ImportError, MitsubaError, SceneError) as error:
        why = str(error)
        if f"No module named '{package}'" in why:
            why = f"{package} is not installed; {variable} may name a Python that has it"
        return {}, {program: why}
    return {f"{program}, {peer.loaded['sampler']}": render}, {}


def means_apart(contenders: Mapping[str, Contender], judge: str) -> dict[str, str]:
    """Return the contenders whose image mean differs from the judge's, and how much.

    A right contender is among them with the probability `contenders.ALPHA`. The seeds are
    fixed, so the result repeats.
    """
    judged = functools.cache(mean_of(contenders[judge]))  # used for each of the others
    found = {}
    for name, contender in contenders.items():
        if name != judge:
            means = compare_means(mean_of(contender), judged, CHECK_SEEDS, CHECK_SPP)
            if not means.passed:
                found[name] = means.sentence(name, judge)
    return found
