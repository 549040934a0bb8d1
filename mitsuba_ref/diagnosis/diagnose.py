"""Names the mistake in a picture: the prediction that explains the difference.

The share that a prediction explains is 1 - D / D0, where D0 is the noise-free mean squared
difference of the picture from the reference and D that from the prediction. Noise is in
neither. Each fitted number costs a little, as it explains a little of any difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from mitsuba_ref.diagnosis.difference import (
    Difference,
    compare,
    noise_free_square,
    residuals,
)
from mitsuba_ref.diagnosis.image_mistakes import (
    IMAGE_MISTAKES,
    Evidence,
    Floats,
    Prediction,
    as_integers,
)

PER_PARAMETER = 0.01  # share that a fitted number must explain to count
FOR_WHOLE = 0.05  # share that a prediction is ahead if what it leaves can be noise
LIKELY = 0.5  # a prediction that explains less is not named
WHOLE = 0.97  # with more than this no further, slower mistakes are tried


@dataclass(frozen=True, eq=False)
class Explanation:
    """A mistake and how much of the difference it explains.

    `whole` says that what is left can be noise.
    """

    prediction: Prediction
    share: float
    whole: bool

    @property
    def rank(self) -> float:
        """Larger is likelier."""
        ahead = FOR_WHOLE if self.whole else 0.0
        return self.share + ahead - PER_PARAMETER * self.prediction.parameters


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """A verdict on a picture, and the mistakes that explain it, the likeliest first."""

    difference: Difference
    explanations: tuple[Explanation, ...] = ()
    tried: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """The names of the mistakes that explain at least `LIKELY`, each once."""
        likely = [one for one in self.explanations if one.share >= LIKELY]
        return list(dict.fromkeys(one.prediction.name for one in likely))


def diagnose(
    evidence: Evidence,
    references: Sequence[Floats],
    lag: int,
    slower: Iterable[Callable[[], Iterable[Prediction]]] = (),
    pictures: Sequence[Floats] = (),
) -> Diagnosis:
    """Judge a picture, and find the mistakes that explain its difference.

    Parameters
    ----------
    evidence
        The picture and what is known of the reference.
    references
        Reference pictures with independent seeds, that which is set aside included.
    lag
        As in `difference.compare`.
    slower
        Sources of further predictions, called in turn until one explains all.
    pictures
        Those that `evidence.picture` is the mean of, if they are several.
    """
    difference = compare(pictures or [evidence.picture], references, lag)
    if not difference.differs:
        return Diagnosis(difference)
    found: list[Explanation] = []
    tried: list[str] = []

    def judge(predictions: Iterable[Prediction]) -> None:
        for prediction in predictions:
            tried.append(prediction.name)
            if prediction.pixels.shape == evidence.picture.shape:
                found.append(_explained(evidence, prediction, lag))

    for mistake in IMAGE_MISTAKES:
        judge(mistake(evidence))
    for number, source in enumerate(slower):
        # the first takes a second, and a fitted number explains some of its mistakes
        if number and any(one.share > WHOLE and one.whole for one in found):
            break
        judge(source())
    ranked = sorted(found, key=lambda one: one.rank, reverse=True)
    return Diagnosis(difference, tuple(ranked), tuple(dict.fromkeys(tried)))


def _explained(evidence: Evidence, prediction: Prediction, lag: int) -> Explanation:
    def kept(pixels: Floats) -> Floats:
        return as_integers(pixels, evidence.levels) if evidence.levels else pixels

    def square(pixels: Floats) -> float:
        return noise_free_square(residuals(evidence.picture, pixels, evidence.scale), lag)

    predicted = kept(prediction.pixels)
    before, after = square(kept(evidence.reference)), max(0.0, square(predicted))
    share = 1.0 - after / before if before > 0.0 else 0.0
    left = compare([evidence.picture], [predicted], lag, evidence.aside)
    return Explanation(prediction, share, not left.differs)
