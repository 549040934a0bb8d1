"""Welch's t-test for the mean of the whole picture, channel by channel.

Most sensitive to what all pixels have in common: a wrong factor, lost or gained energy.
Blind to what cancels over the picture. Needs no independence between pixels, so it holds
for any reconstruction filter.
"""

from __future__ import annotations

from mitsuba_ref.statistics.samples import Floats
from mitsuba_ref.statistics.welch import FamilyTest, Welch, family_test, welch


def channel_means(ours: Floats, theirs: Floats) -> Welch:
    """Compare the means over pictures (K, H, W, C); the arrays have shape (C,)."""
    return welch(ours.mean(axis=(1, 2)), theirs.mean(axis=(1, 2)))


def mean_test(ours: Floats, theirs: Floats) -> FamilyTest:
    """Judge the worst channel, with Sidak's correction for their number."""
    return family_test(channel_means(ours, theirs))
