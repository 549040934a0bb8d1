"""The measured BSDF `merl` for Mitsuba, which has none: one pair of directions at a time.

What `plugins/bsdfs/merl.py` does for sixteen points is written here again, in double
precision and from the file's own bytes: only the format and the choice of directions are
common. In Mitsuba's words `si.wi` is where the path comes from and `wo` where it goes on.
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import product
from math import acos, atan2, cos, floor, pi, sin, sqrt
from typing import Any

import numpy as np

CORNERS = tuple(product((0, 1), repeat=3))

_SCALES = np.array([1.0, 1.15, 1.66]) / 1500.0


def register_merl(mi: Any) -> None:
    """Make `<bsdf type="merl">` known to Mitsuba's current variant.

    Properties
    ----------
    filename : str
        A `.binary` file of Matusik et al. (2003).
    """
    import drjit as dr

    class MeasuredInMitsuba(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            name = props.get("filename")
            path = str(mi.file_resolver().resolve(name))
            self.counts = np.fromfile(path, "<i4", 3).tolist()
            stored = np.fromfile(path, "<f8", offset=12).reshape(3, *self.counts)
            f = np.maximum(stored * _SCALES[:, None, None, None], 0.0)
            self._choose_shares(f)
            # lists of numbers: NumPy's own scalars are ten times as slow one by one
            self.f = {at: f[(slice(None), *at)].tolist() for at in np.ndindex(*self.counts)}
            front = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [front]
            self.m_flags = front

        def _choose_shares(self, f: Any) -> None:
            """Find how often each cell of theta_h is chosen, and the cosine instead."""
            count, differences = self.counts[0], self.counts[1]
            edges = np.pi / 2 * np.linspace(0, 1, count + 1) ** 2
            middle = (np.arange(differences) + 0.5) * np.pi / 2 / differences
            around = np.sin(2 * middle) / np.sin(2 * middle).sum()
            bright = np.array([0.212671, 0.715160, 0.072169])
            mean = np.einsum("c,chdp,d->h", bright, f, around) / self.counts[2]
            cosine = np.diff(np.sin(2 * np.minimum(edges, np.pi / 4)) ** 2)
            light = mean * cosine
            light += 1e-3 * light.mean() + np.finfo(float).tiny
            shares = light / light.sum()
            self.share_of_cosine = float(
                np.clip(np.minimum(cosine, shares).sum(), 0.1, 0.9)
            )
            self.shares, self.edges = shares.tolist(), edges.tolist()
            self.squares = (np.sin(0.5 * edges) ** 2).tolist()
            self.cumulated = [0.0, *np.cumsum(shares).tolist()]

        def sample(
            self, ctx: Any, si: Any, sample1: float, sample2: Any, active: bool = True
        ) -> tuple[Any, Any]:
            if (
                not si.wi[2] > 0.0
            ):  # NaN too; a blend must find no direction here, as of other BSDFs
                return dr.zeros(mi.BSDFSample3f), mi.Color3f(0.0)
            if sample1 < self.share_of_cosine:
                wo = mi.warp.square_to_cosine_hemisphere(sample2)
            else:
                x, y = sample2
                phi = 2 * pi * y
                k = min(bisect_right(self.cumulated, x) - 1, len(self.shares) - 1)
                begin, end = self.squares[k], self.squares[k + 1]
                square = begin + (end - begin) * (x - self.cumulated[k]) / self.shares[k]
                sine = 2 * sqrt(square * (1 - min(square, 1.0)))
                h = mi.Vector3f(sine * cos(phi), sine * sin(phi), 1 - 2 * square)
                wo = mi.reflect(si.wi, h)
            chosen = mi.BSDFSample3f(wo)
            value, chosen.pdf = self.eval_pdf(ctx, si, wo)
            chosen.eta = 1.0
            chosen.sampled_type = int(mi.BSDFFlags.GlossyReflection)
            chosen.sampled_component = 0
            return chosen, value / chosen.pdf if chosen.pdf > 0.0 else mi.Color3f(0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: bool = True) -> Any:
            return self.eval_pdf(ctx, si, wo)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: bool = True) -> float:
            return self.eval_pdf(ctx, si, wo)[1]

        def eval_pdf(
            self, ctx: Any, si: Any, wo: Any, active: bool = True
        ) -> tuple[Any, float]:
            ax, ay, az = si.wi
            bx, by, bz = wo
            if not (az > 0.0 and bz > 0.0):  # NaN too, where a frame has none
                return mi.Color3f(0.0), 0.0
            hx, hy, hz = ax + bx, ay + by, az + bz
            scale = 1 / sqrt(hx * hx + hy * hy + hz * hz)
            hx, hy, hz = scale * hx, scale * hy, scale * hz
            half, phi = atan2(sqrt(hx * hx + hy * hy), hz), atan2(hy, hx)
            towards = ax * hx + ay * hy + az * hz
            k = min(bisect_right(self.edges, half) - 1, len(self.shares) - 1)
            solid_angle = 4 * pi * (self.squares[k + 1] - self.squares[k])
            by_half = self.shares[k] / solid_angle / (4 * towards)
            p = self.share_of_cosine

            # wo in the frame of the half vector, whose x axis lies in the plane of n and h
            along = bx * cos(phi) + by * sin(phi)
            x = along * cos(half) - bz * sin(half)
            y = by * cos(phi) - bx * sin(phi)
            units = (
                sqrt(2 * half / pi),
                2 * acos(min(bx * hx + by * hy + bz * hz, 1.0)) / pi,
                atan2(y, x) / pi % 1.0,
            )
            color = mi.Color3f([bz * value for value in self._interpolated(units)])
            return color, p * bz / pi + (1 - p) * by_half

        def _interpolated(self, units: tuple[float, float, float]) -> list[float]:
            """Return f at angles that run from 0 to 1, a sum over eight cells."""
            first, t = [], []
            for unit, count, periodic in zip(
                units, self.counts, (False, False, True), strict=True
            ):
                position = unit * count - 0.5
                before = floor(position)
                if not periodic:
                    before = max(min(before, count - 2), 0)
                first.append(before)
                t.append(min(max(position - before, 0.0), 1.0))
            total = [0.0, 0.0, 0.0]
            for a, b, c in CORNERS:
                weight = (t[0] if a else 1 - t[0]) * (t[1] if b else 1 - t[1])
                weight *= t[2] if c else 1 - t[2]
                turn = (first[2] + c) % self.counts[2]
                cell = self.f[first[0] + a, first[1] + b, turn]
                for channel in range(3):
                    total[channel] += weight * cell[channel]
            return total

        def to_string(self) -> str:
            return f"MeasuredInMitsuba[cells = {self.counts}]"

    mi.register_bsdf("merl", MeasuredInMitsuba)
