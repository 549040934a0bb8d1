"""Render a scene with one thing less at a time, then with all that it does not need.

The least model is found greedily: what saves most time for the same noise comes first, and
stays where the loss of all that was left out so far, measured anew, is within tolerance.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import renderer
from mitsuba_ref.our_renderer.whole_picture import whole
from renderer.advice.simplifications import differs, offered, simplified
from renderer.errors import SceneError
from renderer.rendering.picture.image import Image
from renderer.rendering.render_options import MOST_SAMPLES
from renderer.scene.scene import Scene
from reports.needs.claims import claims_of
from reports.needs.content import content_of
from reports.needs.losses import loss_between
from reports.needs.record import Claim, Loss, SceneNeeds

TIMED = 0.25  # seconds of full pictures, beside which those of each model are timed
REFERENCE_SEED = 4_000_000_000
DEEPEST = 32  # segments; what needs more is not cut
SLOWER = 1.05  # a model that takes longer than this times the last is no gain
ROUNDING = 1e-5  # relative: n equal samples are not quite n times one of them

Picture = NDArray[np.float32]


@dataclass
class Study:
    """One scene on its way through the measurements."""

    scene: Scene
    spp: int
    seeds: int
    tolerance: float
    timed: float = TIMED
    say: Callable[[str], None] = lambda _: None
    full: list[Picture] = field(default_factory=list)  # picture k has seed k
    reference: Picture = field(default_factory=lambda: np.zeros((0, 0, 3), np.float32))
    seconds: float = 0.0
    differences: dict[str, Picture] = field(default_factory=dict)  # words -> mean

    def render(self, scene: Scene, seed: int, spp: int | None = None) -> Image:
        """Render with a sampler whose numbers depend on nothing but their place."""
        image = renderer.render(scene, spp or self.spp, seed, sampler="independent")
        return whole(image)

    def start(self) -> None:
        """Render the full scene with every seed."""
        self.say("the full scene")
        self.render(self.scene, 0, 1)  # compiles and builds
        images = [self.render(self.scene, seed) for seed in range(self.seeds)]
        self.full = [image.pixels for image in images]
        samples = min(self.spp * self.seeds, MOST_SAMPLES)
        self.reference = self.render(self.scene, REFERENCE_SEED, samples).pixels
        self.seconds = float(np.median([image.seconds for image in images]))

    def loss(self, words: Sequence[str]) -> Loss:
        """Measure simplifications, all of them at once.

        Raises
        ------
        AssertionError
            If the full scene is not rendered twice alike.
        """
        name = " ".join(words)
        self.say(name)
        less = renderer.simplify(self.scene, *words)
        self.render(less, 0, 1)
        pictures: list[Picture] = []
        times: list[float] = []
        full_times: list[float] = []
        while len(pictures) < self.seeds or sum(full_times) < self.timed:
            # both take turns: the machine's pace drifts
            seed = len(times) % self.seeds
            if not full_times or sum(full_times) < self.timed:
                full_times.append(self._full_again(seed))
            image = self.render(less, seed)
            times.append(image.seconds)
            if len(pictures) < self.seeds:
                pictures.append(image.pixels)
        # the best of as many turns each: what disturbs a run only makes it longer
        time = min(times[: len(full_times)]) / min(full_times)
        told = [one.partition(": ")[2] for one in less.description.simplified]
        told = told[len(self.scene.description.simplified) :]
        found = loss_between(
            self.full, pictures, self.reference, words, "; ".join(told), time
        )
        self.differences[name] = mean_picture(pictures) - mean_picture(self.full)
        return found

    def is_same(self, word: str) -> bool:
        """Return whether a simplification leaves the description as it is."""
        full = self.scene.description
        return not differs(full, simplified(full, word))

    def _full_again(self, seed: int) -> float:
        image = self.render(self.scene, seed)
        assert np.array_equal(image.pixels, self.full[seed], equal_nan=True)
        return max(image.seconds, 1e-9)


def mean_picture(pictures: Sequence[Picture]) -> Picture:
    """Return the mean of pictures, summed in double precision."""
    return np.asarray(np.mean(pictures, axis=0, dtype=np.float64), np.float32)


def measure(
    path: Path,
    *,
    parameters: Mapping[str, Any] | None = None,
    spp: int = 32,
    seeds: int = 6,
    tolerance: float = 0.01,
    timed: float = TIMED,
    say: Callable[[str], None] = lambda _: None,
) -> tuple[SceneNeeds, Study]:
    """Measure one scene file.

    Parameters
    ----------
    path
        The scene.
    parameters
        Values for the `<default>`s of the file.
    spp, seeds
        Samples per pixel of each picture, and pictures of each model; at least 3.
    tolerance
        What the upper end of the loss's interval may be; 0.01 is 1 %.
    timed
        Seconds that full pictures are rendered for beside each model, to time both.
    say
        Told what is measured now.

    Raises
    ------
    SceneError
        If the scene cannot be rendered.
    AssertionError
        If something that the plan leaves out for nothing changes the picture.
    """
    scene = renderer.load_file(path, **(parameters or {}))
    content = content_of(scene)  # before the hours in which somebody may edit it
    study = Study(scene, spp, seeds, tolerance, timed, say)
    study.start()
    changing, absent = offered(scene.description)
    losses = [*_depths(study), *(study.loss([word]) for word in changing)]
    claims = claims_of(scene, spp)
    losses += _check_claims(study, claims, losses)
    claimed = [word for claim in claims for word in claim.words if study.is_same(word)]
    _check_absent(study, [*absent, *claimed])
    least = least_model(study, losses)
    words = least.words if least is not None else []
    film = scene.description.camera.film
    needs = SceneNeeds(
        scene=str(path),
        content=content,
        size=[film.crop_width, film.crop_height],
        spp=spp,
        seeds=seeds,
        tolerance=tolerance,
        seconds=study.seconds,
        losses=losses,
        absent=absent,
        claims=claims,
        least=least,
        command=command(path, words),
    )
    return needs, study


def command(path: Path, words: Sequence[str]) -> str:
    """Return the command that renders the model."""
    named = [part for word in words for part in ("--simplify", word)]
    return shlex.join(["python", "-m", "renderer", str(path), *named])


def _depths(study: Study) -> list[Loss]:
    """Return the losses of depth 1, 2, ... up to the first within the tolerance."""
    losses: list[Loss] = []
    full = study.scene.description
    for depth in range(1, DEEPEST + 1):
        word = f"depth={depth}"
        if not differs(full, simplified(full, word)):
            break
        losses.append(study.loss([word]))
        if losses[-1].error_high <= study.tolerance:
            break
    return losses


def least_model(study: Study, losses: Sequence[Loss]) -> Loss | None:
    """Return the model that leaves out the most time, and its loss; None: the full one.

    Time that is saved by more noise is none: neither time nor time for the same noise may
    grow.
    """
    least: Loss | None = None
    for one in sorted(losses, key=lambda loss: loss.cost):
        if one.error_high > study.tolerance:
            continue
        trial = one
        if least is not None:
            shorter = renderer.simplify(study.scene, *least.words).description
            try:
                if not differs(shorter, simplified(shorter, one.words[0])):
                    continue
            except SceneError:  # no-specular=X, after specular=off: no such name is left
                continue
            trial = study.loss([*least.words, *one.words])
        time, cost = (1.0, 1.0) if least is None else (least.time, least.cost)
        cheaper = trial.time <= SLOWER * time and trial.cost <= SLOWER * cost
        if cheaper and trial.error_high <= study.tolerance:
            least = trial
    return least


def _check_absent(study: Study, absent: Sequence[str]) -> None:
    """Check that leaving out what is not there changes no bit, all at once."""
    if absent:
        same = study.render(renderer.simplify(study.scene, *absent), 0)
        assert np.array_equal(same.pixels, study.full[0], equal_nan=True), absent


def _check_claims(
    study: Study, claims: Sequence[Claim], losses: Sequence[Loss]
) -> list[Loss]:
    """Check that what the plan leaves out loses nothing at all; return further losses."""
    measured = {" ".join(loss.words): loss for loss in losses}
    more: list[Loss] = []
    for claim in claims:
        for word in claim.words:
            if study.is_same(word):
                continue
            if word not in measured:
                measured[word] = study.loss([word])
                more.append(measured[word])
            assert measured[word].exact, (claim, measured[word])
        if claim.at_its_word:
            name = study.scene.description.integrator.name
            image = renderer.render(
                study.scene, study.spp, 0, integrator=name, sampler="independent"
            )
            most = float(np.abs(study.full[0]).max())
            apart = float(np.abs(image.pixels - study.full[0]).max())
            assert apart <= ROUNDING * most, (claim, apart)
    return more
