"""A scene with noise: seconds and relMSE of all contenders, in turn, at several counts."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from pathlib import Path

import numpy as np

import renderer
from mitsuba_ref.reference.errors import MitsubaError, MitsubaTimeout
from mitsuba_ref.speed.timed_mitsuba import TimedMitsuba
from mitsuba_ref.statistics.equal_error import relative_mse_of
from renderer.rendering.planning.make_plan import make_plan
from renderer.scene.scene import Scene
from renderer.scene_file.objects.films import round_sample_count
from reports.errors import ReportError
from reports.speed_accuracy.contenders import (
    PEERS,
    THEIR_SAMPLERS,
    Contender,
    Key,
    Picture,
    Say,
    Settings,
    of_mitsuba,
    of_ours,
    other_means,
    parameters_of,
)
from reports.speed_accuracy.record import OURS, Curve, NoisyScene, Pictures
from reports.speed_accuracy.references import SAMPLER, long_picture

METHODS = ("direct", "path", "whitted")
# Of ours as well: its rays leave a surface up to 9e-5 (1 + |p|) away and pass over bumps
# that are lower. At the terminators of `ball-and-sun` that lets in 1e-4 of the picture's
# light, in 1000 of 230,400 pixels (16 such pixels of a coarser ball: 1.680 in double
# precision, 1.685 by our own rule, 1.721 by Mitsuba's). Beside a reference of Mitsuba's our
# own, tighter rule has a relMSE of 6.5e-5 with any number of samples, half that of 16.
RAY_OFFSET = "mitsuba"
JUDGES = ("independent", SAMPLER)  # by whose means and long pictures others are judged

# Mitsuba 3.9.1's `ldsampler` makes NaN of the scene white-furnace, and never ends a path of
# its seed 4 (16 samples, 48 x 32).
NOT_FINITE = "its picture has values that are not finite"
PATIENCE = 120.0  # [s] for one picture
FIRST_PATIENCE = 60.0  # [s] for the first one, compilation included
# Mitsuba 3.9.1's `llvm_ad_rgb` takes 11 to 20 s for each picture of 10,000 instances, also
# for the same one again, and more than a minute where two such scenes are loaded; here one
# is for each sampler.
ANEW = "it goes through all instances anew for each picture"
ONE_IS_ENOUGH = "left out of large scenes, in which {} takes part"


def measure_noisy(
    path: Path, settings: Settings, say: Say, *, one_peer: bool = False
) -> NoisyScene:
    """Render one scene with all contenders in turn.

    Parameters
    ----------
    path
        The scene file.
    settings
        How much is measured.
    say
        Is told how far it is.
    one_peer
        Whether the last of `PEERS` that can draw the scene is enough.

    Raises
    ------
    ReportError
        If the image mean of one of ours differs by more than noise: then nothing is timed
        (a peer is left out). If a picture holds what is no number.
    SceneError
        If we cannot render it.
    """
    parameters = parameters_of(path, settings, "test")
    scene = renderer.load_file(path, **parameters)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        contenders = _ours(scene, settings, say)
        unavailable: dict[str, str] = {}
        there = ""
        for variant in reversed(PEERS) if one_peer else PEERS:
            if one_peer and there:
                unavailable[f"mitsuba {variant}"] = ONE_IS_ENOUGH.format(there)
                continue
            say(f"starting mitsuba {variant}")
            try:
                theirs = _theirs(stack, variant, path, parameters, settings, folder)
            except MitsubaError as error:
                late = isinstance(error, MitsubaTimeout) and scene.placements is not None
                unavailable[f"mitsuba {variant}"] = (
                    f"{error}: {ANEW}" if late else str(error)
                )
                continue
            there = variant
            for key, contender in theirs.items():
                if contender is None:
                    unavailable[str(key)] = NOT_FINITE
                else:
                    contenders[key] = contender
        # any peer would do; without one we are our own judge, which says nothing of bias
        peers = [key for key in contenders if key.renderer != OURS]
        judge = [next(iter(contenders)), *peers][-1]._replace(sampler="independent")
        say(f"image means of {len(contenders)} contenders")
        long = judge._replace(sampler=SAMPLER)
        for key, why in other_means(contenders, judge).items():
            if key.renderer == OURS or key == long:
                raise ReportError(f"{path}: {why}; nothing was timed")
            del contenders[key]  # a wrong picture is no peer, and must be seen
            unavailable[str(key)] = why
        files = (*map(Path, scene.description.files), parameters)
        reference = long_picture(
            long,
            contenders[long],
            settings.reference,
            # of ours, which all kernels decide, nothing is kept
            None if judge.renderer == OURS else files,
            say,
        )
        curves = [
            Curve(
                *key,
                [
                    Pictures(round_sample_count(key.sampler, spp), [], [])
                    for spp in settings.spp
                ],
            )
            for key in contenders
        ]
        for number, spp in enumerate(settings.spp):
            for seed in range(settings.seeds):
                say(f"{spp} samples, seed {seed + 1} of {settings.seeds}")
                for curve, (key, contender) in zip(curves, contenders.items(), strict=True):
                    seconds, picture = contender(seed, spp)
                    found = _error(path, key, seed, picture, reference.picture)
                    curve.pictures[number].seconds.append(seconds)
                    curve.pictures[number].errors.append(found)
    height, width = reference.picture.shape[:2]
    return NoisyScene(
        path.parent.name,
        width,
        height,
        reference.origin,
        reference.error,
        curves,
        unavailable,
    )


def _ours(scene: Scene, settings: Settings, say: Say) -> dict[Key, Contender]:
    """Return our samplers, and the other methods where they give the same picture, warm."""
    plan = make_plan(scene)
    found = {}
    for sampler in dict.fromkeys((*settings.samplers, SAMPLER, "independent")):
        key = Key(OURS, plan.method, sampler)
        ways = {"sampler": sampler, "ray_offset": RAY_OFFSET}
        found[key] = of_ours(scene, settings.threads, **ways)
    if plan.max_depth <= 2:  # direct light alone, whoever gathers it
        for method in METHODS:
            if method != plan.method:
                key = Key(OURS, method, settings.samplers[0])
                ways = {"sampler": key.sampler, "ray_offset": RAY_OFFSET}
                found[key] = of_ours(scene, settings.threads, integrator=method, **ways)
    for key, contender in found.items():
        say(f"compiling {key.method}, {key.sampler}")
        contender(0, settings.spp[0])
    return found


def _theirs(
    stack: ExitStack,
    variant: str,
    path: Path,
    parameters: dict[str, str],
    settings: Settings,
    folder: Path,
) -> dict[Key, Contender | None]:
    """Return a variant with each of its samplers, warm; None for pictures with NaN.

    Raises
    ------
    MitsubaError
        If one of them does not work: then the variant is left out as a whole.
    """
    with ExitStack() as opened:
        peer = opened.enter_context(
            TimedMitsuba(variant, path, parameters, settings.threads, THEIR_SAMPLERS)
        )
        peer.time_limit = FIRST_PATIENCE
        of_mitsuba(peer, folder, THEIR_SAMPLERS[0])(0, settings.spp[0])
        peer.time_limit = PATIENCE
        found: dict[Key, Contender | None] = {}
        for sampler in THEIR_SAMPLERS:
            contender = of_mitsuba(peer, folder, sampler)
            # JIT variants compile for each number of samples
            warm = settings.spp if "_ad_" in variant else settings.spp[:1]
            finite = all(np.isfinite(contender(0, spp)[1]).all() for spp in warm)
            if not finite and sampler in JUDGES:
                raise MitsubaError(f"{variant} {sampler}: {NOT_FINITE}")
            key = Key(f"mitsuba {variant}", "", sampler)
            found[key] = contender if finite else None
        stack.push(opened.pop_all())
    return found


def _error(path: Path, key: Key, seed: int, picture: Picture, reference: Picture) -> float:
    try:
        found = relative_mse_of(picture, reference)
    except ValueError as error:
        raise ReportError(f"{path}: {key}, seed {seed}: {error}") from error
    if found == 0.0:
        raise ReportError(f"{path}: {key}, seed {seed}: there is no noise to be measured")
    return found
