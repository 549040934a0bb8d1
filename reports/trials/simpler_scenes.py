"""Render a scene with one thing less at a time, then with all that it does not need.

The least model is found greedily: what saves most time for the same noise comes first, and
stays where the loss of all that was left out so far, measured anew, is within tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.our_renderer.whole_picture import whole
from renderer.advice.simplifications import differs, offered, simplified
from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.rendering.render_options import MOST_SAMPLES
from renderer.scene.scene import Scene
from reports.bench.timing import Interval, ratio, take_turns
from reports.trials.losses import Loss, loss_between
from reports.trials.plan_claims import Claim, claims_of

REFERENCE_SEED = 4_000_000_000
DEEPEST = 32  # segments; what needs more is not cut
SLOWER = 1.05  # a model that takes longer than this times the last is no gain
ROUNDING = 1e-5  # relative: n equal samples are not quite n times one of them
MOST_TURNS = 10_000

Picture = NDArray[np.float32]


class Simpler(NamedTuple):
    """A scene with less in it, compared with the full one."""

    words: list[str]  # NAME=VALUE
    loss: Loss
    time: float  # over that of the full scene
    time_interval: Interval
    difference: Picture  # of the mean pictures

    @property
    def cost(self) -> float:
        """Time for the same noise, over that of the full scene."""
        return self.time * (1.0 if self.loss.noise is None else self.loss.noise)


@dataclass
class Trial:
    """One scene on its way through the measurements."""

    scene: Scene
    spp: int
    seeds: int
    tolerance: float
    timed: float  # seconds of full pictures, at least, to time each simpler scene with
    show: Callable[[str], None] = lambda _: None
    full: list[Picture] = field(default_factory=list)  # picture k has seed k
    reference: Picture = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))
    seconds: float = 0.0  # of a full picture

    def render(self, scene: Scene, seed: int, spp: int | None = None) -> Image:
        """Render with a sampler whose numbers depend on nothing but their place."""
        image = renderer.render(scene, spp or self.spp, seed, sampler="independent")
        return whole(image)

    def start(self) -> None:
        """Render the full scene with every seed."""
        self.show("the full scene")
        self.render(self.scene, 0, 1)  # compiles and builds
        images = [self.render(self.scene, seed) for seed in range(self.seeds)]
        self.full = [image.pixels for image in images]
        samples = min(self.spp * self.seeds, MOST_SAMPLES)
        self.reference = self.render(self.scene, REFERENCE_SEED, samples).pixels
        self.seconds = float(np.median([image.seconds for image in images]))

    def without(self, words: Sequence[str]) -> Simpler:
        """Measure simplifications, all of them at once.

        Raises
        ------
        ValueError
            If the full scene is not rendered twice alike.
        """
        self.show(" ".join(words))
        scene = renderer.simplify(self.scene, *words)
        self.render(scene, 0, 1)
        pictures: list[Picture] = []

        def full(turn: int) -> float:
            image = self.render(self.scene, turn % self.seeds)
            self.check_same(image.pixels, "rendering it again", turn % self.seeds)
            return max(image.seconds, 1e-9)

        def less(turn: int) -> float:
            image = self.render(scene, turn % self.seeds)
            if turn < self.seeds:
                pictures.append(image.pixels)
            return max(image.seconds, 1e-9)

        times = take_turns(
            {"less": less, "full": full},
            MOST_TURNS,
            enough=2 * self.timed,
            least=self.seeds,
        )
        return Simpler(
            list(words),
            loss_between(self.full, pictures, self.reference),
            *ratio(times["less"], times["full"]),
            mean_picture(pictures) - mean_picture(self.full),
        )

    def check_same(self, pixels: Picture, what: str, seed: int = 0) -> None:
        """Raise a ValueError if a picture is not the full one of a seed, bit for bit."""
        if not np.array_equal(pixels, self.full[seed], equal_nan=True):
            raise ValueError(f"{what} changes the picture, and should not change a bit")

    def is_same(self, word: str) -> bool:
        """Return whether a simplification leaves the description as it is."""
        full = self.scene.description
        return not differs(full, simplified(full, word))


def mean_picture(pictures: Sequence[Picture]) -> Picture:
    """Return the mean of pictures, summed in double precision."""
    return np.asarray(np.mean(pictures, axis=0, dtype=np.float64), np.float32)


class Needs(NamedTuple):
    """What a scene needs."""

    simpler: dict[str, Simpler]  # by their words; each changes the scene
    absent: list[str]  # words of what the scene has nothing of
    claims: list[Claim]  # of the plan
    least: Simpler | None  # the least model; None: the full scene


def needs_of(trial: Trial) -> Needs:
    """Measure what each simplification loses and saves, and find the least model.

    Raises
    ------
    ValueError
        If something changes the picture that the scene lacks or that the plan leaves out
        as without effect.
    """
    trial.start()
    changing, absent = offered(trial.scene.description)
    simpler = _depths(trial)
    simpler |= {word: trial.without([word]) for word in changing}
    claims = claims_of(trial.scene, trial.spp)
    _check_claims(trial, claims, simpler)
    claimed = [word for claim in claims for word in claim.words if trial.is_same(word)]
    if nothing := [*absent, *claimed]:
        same = trial.render(renderer.simplify(trial.scene, *nothing), 0)
        trial.check_same(same.pixels, f"{', '.join(nothing)}: leaving out what is absent")
    least = least_model(trial, list(simpler.values()))
    if least is not None:
        simpler[" ".join(least.words)] = least
    return Needs(simpler, absent, claims, least)


def _depths(trial: Trial) -> dict[str, Simpler]:
    """Measure depth 1, 2, ... up to the first within the tolerance."""
    found: dict[str, Simpler] = {}
    for depth in range(1, DEEPEST + 1):
        word = f"depth={depth}"
        if trial.is_same(word):
            break
        found[word] = trial.without([word])
        if found[word].loss.error_high <= trial.tolerance:
            break
    return found


def least_model(trial: Trial, simpler: Sequence[Simpler]) -> Simpler | None:
    """Return the model that leaves out the most time; None: the full one.

    Time that is saved by more noise is none: neither time nor time for the same noise may
    grow.
    """
    least: Simpler | None = None
    for one in sorted(simpler, key=lambda one: one.cost):
        if one.loss.error_high > trial.tolerance:
            continue
        both = one
        if least is not None:
            shorter = renderer.simplify(trial.scene, *least.words).description
            try:
                if not differs(shorter, simplified(shorter, one.words[0])):
                    continue
            except SceneError:  # no-specular=X, after specular=off: no such name is left
                continue
            both = trial.without([*least.words, *one.words])
        time, cost = (1.0, 1.0) if least is None else (least.time, least.cost)
        cheaper = both.time <= SLOWER * time and both.cost <= SLOWER * cost
        if cheaper and both.loss.error_high <= trial.tolerance:
            least = both
    return least


def _check_claims(
    trial: Trial, claims: Sequence[Claim], simpler: dict[str, Simpler]
) -> None:
    """Check that what the plan leaves out loses nothing; add what was not measured yet."""
    for claim in claims:
        for word in claim.words:
            if trial.is_same(word):
                continue
            if word not in simpler:
                simpler[word] = trial.without([word])
            if not simpler[word].loss.exact:
                raise ValueError(
                    f"{word} changes the picture, though the plan leaves out as without "
                    f"effect: {claim.text}"
                )
        if claim.verbatim:
            name = trial.scene.description.integrator.name
            image = renderer.render(
                trial.scene, trial.spp, 0, integrator=name, sampler="independent"
            )
            most = float(np.abs(trial.full[0]).max())
            apart = float(np.abs(image.pixels - trial.full[0]).max())
            if apart > ROUNDING * most:
                raise ValueError(f"{name} differs by {apart:.3g} from: {claim.text}")
