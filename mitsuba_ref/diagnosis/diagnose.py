"""Names the mistake in a picture: the prediction that explains the difference.

The share that a prediction explains is 1 - D / D0, where D0 is the noise-free mean squared
difference of the picture from the reference and D that from the prediction. Noise is in
neither. Each fitted number costs a little, as it explains a little of any difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
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
)

PER_PARAMETER = 0.01  # share that a fitted number must explain to count
FOR_WHOLE = 0.05  # added to the rank of a prediction whose remainder can be noise
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
    def named(self) -> list[Explanation]:
        """The mistakes that explain at least `LIKELY`, each name once."""
        first: dict[str, Explanation] = {}
        for one in self.explanations:
            if one.share >= LIKELY:
                first.setdefault(one.prediction.name, one)
        return list(first.values())

    @property
    def names(self) -> list[str]:
        """Their names."""
        return [one.prediction.name for one in self.named]


def diagnose(
    difference: Difference,
    evidence: Evidence,
    lag: int,
    slower: Iterable[Callable[[], Iterable[Prediction]]] = (),
) -> Diagnosis:
    """Find the mistakes that explain a difference.

    Parameters
    ----------
    difference
        What the tests say of the picture.
    evidence
        The picture and what is known of the reference.
    lag
        As in `difference.compare`.
    slower
        Sources of further predictions, called in turn until one explains all.
    """
    before = _square(evidence, evidence.reference, lag)
    found: list[Explanation] = []
    tried: list[str] = []

    def judge(predictions: Iterable[Prediction]) -> None:
        for prediction in predictions:
            tried.append(prediction.name)
            if prediction.pixels.shape == evidence.picture.shape:
                found.append(_explained(evidence, prediction, lag, before))

    for mistake in IMAGE_MISTAKES:
        judge(mistake(evidence))
    for number, source in enumerate(slower):
        # the first takes a second, and a fitted number explains some of its mistakes
        if number and any(one.share > WHOLE and one.whole for one in found):
            break
        judge(source())
    ranked = sorted(found, key=lambda one: one.rank, reverse=True)
    return Diagnosis(difference, tuple(ranked), tuple(dict.fromkeys(tried)))


def _explained(
    evidence: Evidence, prediction: Prediction, lag: int, before: float
) -> Explanation:
    after = max(0.0, _square(evidence, prediction.pixels, lag))
    share = 1.0 - after / before if before > 0.0 else 0.0
    predicted = evidence.as_kept(prediction.pixels)
    left = compare([evidence.picture], [predicted], lag, evidence.aside)
    return Explanation(prediction, share, not left.differs)


def _square(evidence: Evidence, pixels: Floats, lag: int) -> float:
    """Return the noise-free mean squared difference of the picture from another one."""
    kept = evidence.as_kept(pixels)
    return noise_free_square(residuals(evidence.picture, kept, evidence.scale), lag)
