"""What cannot be replayed."""

from __future__ import annotations

from renderer.errors import NotReplayable
from renderer.replay.numbers.pixel_seeds import BLOCK_SIZE
from renderer.scene_file.description import Integrator

MOST_SAMPLES = 256  # of `direct` at a point: 6 KB of numbers for each pixel


def check_replay(asked: Integrator, method: str, extended: bool) -> None:
    """Refuse integrators for which Mitsuba's order of random numbers cannot be followed.

    Parameters
    ----------
    asked
        The integrator of the file.
    method
        What is rendered.
    extended
        Whether lights have an area.

    Raises
    ------
    NotReplayable
        One line that says why, and what is possible.
    """
    if method == "work":
        raise NotReplayable(
            "sampler 'mitsuba': Mitsuba has no integrator that counts work; possible are "
            "path, direct, depth, aov and whitted"
        )
    integrators = (asked, asked.nested or asked)
    if any(i.block_size not in (0, BLOCK_SIZE) or not i.one_pass for i in integrators):
        raise NotReplayable(
            "sampler 'mitsuba': the file divides the work in its own way (block_size, "
            f"samples_per_pass); possible are block_size {BLOCK_SIZE} and a single pass"
        )
    if method == "whitted" and extended:
        raise NotReplayable(
            "sampler 'mitsuba': a tree of rays that samples lights with an area draws in "
            "the order of the tree; possible are path, direct, and whitted with point, "
            "spot and directional lights"
        )
    most = max(asked.emitter_samples, asked.bsdf_samples)
    if method == "direct" and most > MOST_SAMPLES:
        raise NotReplayable(
            f"sampler 'mitsuba': direct with {asked.emitter_samples} emitter_samples and "
            f"{asked.bsdf_samples} bsdf_samples cannot be replayed; possible are up to "
            f"{MOST_SAMPLES}, whose numbers are drawn ahead"
        )
    if asked.strategy != "both" or not asked.caustics:
        raise NotReplayable(
            "sampler 'mitsuba': Mitsuba has no integrator with one of the two ways to find "
            "light, or without caustics; possible is the scene without sampling=lights, "
            "sampling=bsdfs and caustics=off"
        )
    if asked.stands_for:
        raise NotReplayable(
            f"sampler 'mitsuba': {asked.stands_for}, which is rendered by path here, draws "
            "in another order; its pictures agree in the mean"
        )
