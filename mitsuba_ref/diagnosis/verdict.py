"""What a comparison of pictures says, in words and as values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from mitsuba_ref.diagnosis.diagnose import Diagnosis, Explanation
from mitsuba_ref.diagnosis.difference import FALSE_ALARMS, Difference
from mitsuba_ref.diagnosis.image_mistakes import Evidence

HIDDEN = 0.1  # relative bias of the mean; if less is not seen, a verdict says little
MOST_NAMED = 3  # mistakes in the sentences


@dataclass(frozen=True, eq=False)
class Comparison:
    """A verdict on a picture.

    Parameters
    ----------
    diagnosis
        The tests, and the mistakes that explain the difference, the likeliest first.
    evidence
        The mean of the pictures and of the references, and AOVs of the scene.
    notes
        How the pictures were read, and how far the verdict can be trusted.
    """

    diagnosis: Diagnosis
    evidence: Evidence
    notes: tuple[str, ...] = ()

    @property
    def difference(self) -> Difference:
        """What the tests say."""
        return self.diagnosis.difference

    @property
    def differs(self) -> bool:
        """Whether the picture differs from the reference by more than noise."""
        return self.difference.differs

    @property
    def named(self) -> list[Explanation]:
        """The likeliest mistakes, each name once; none if no known one explains half."""
        return self.diagnosis.named[:MOST_NAMED]

    def sentences(self) -> list[str]:
        """Return the verdict in words, most important first."""
        found = self.difference
        if not found.differs:
            lines = [
                "The pictures do not differ by more than noise.",
                *filter(None, [self.doubt]),
                f"A bias of {100 * found.detectable:.2g} % of the mean would have been "
                "seen with a probability of 99 %.",
            ]
        else:
            lines = [
                f"The pictures differ by more than noise (p {self.shown_p}): by "
                f"{100 * found.size:.3g} % of the local brightness, and in the mean by "
                f"{100 * found.mean_bias:+.3g} %."
            ]
            for rank, one in enumerate(self.named, 1):
                left = "nothing but noise is left" if one.whole else "a difference is left"
                lines.append(
                    f"{rank}. {one.prediction.name}: {one.prediction.sentence} It explains "
                    f"{100 * one.share:.3g} % of the difference; {left}."
                )
                if rank == 1:
                    lines.append(f"   {one.prediction.advice}")
            if not self.named:
                tried = len(self.diagnosis.tried)
                lines.append(f"None of {tried} known mistakes explains half of it.")
        cases = f"{1.0 / FALSE_ALARMS:,.0f}"
        lines.append(f"Equal pictures are called different in 1 of {cases} cases.")
        return [*lines, *(f"Note: {note}." for note in self.notes)]

    @property
    def shown_p(self) -> str:
        """The probability that noise alone does this, in words after "p"."""
        p = self.difference.p_value
        return f"= {p:.2g}" if p > 1e-300 else "< 1e-300"

    @property
    def doubt(self) -> str:
        """A warning if the pictures may differ much and noise hides it; else empty."""
        if self.differs or self.difference.detectable < HIDDEN:
            return ""
        return (
            "But this says little: noise, perhaps of a few very bright pixels, hides "
            "larger differences than usual. Use more samples."
        )

    def record(self) -> dict[str, Any]:
        """Return the verdict as plain values, for programs."""
        found = self.difference
        return {
            "differs": found.differs,
            "p_value": found.p_value,
            "size": found.size,
            "mean_bias": found.mean_bias,
            "detectable": found.detectable,
            "mistakes": [
                {
                    "name": one.prediction.name,
                    "sentence": one.prediction.sentence,
                    "advice": one.prediction.advice,
                    "share": one.share,
                    "whole": one.whole,
                }
                for one in self.diagnosis.explanations[:5]
            ],
            "notes": list(self.notes),
        }
