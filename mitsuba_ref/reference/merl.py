"""The measured BSDF `merl` for Mitsuba, which has none: one pair of directions at a time.

What `renderer/kinds/bsdfs/merl.py` does for sixteen points is written here again, in double
precision and from the file's own bytes: only the format and the choice of directions are
common. In Mitsuba's words `si.wi` is where the path comes from and `wo` where it goes on.
"""

from __future__ import annotations

from typing import Any

import numpy as np

_SCALES = np.array([1.0, 1.15, 1.66]) / 1500.0


def register_merl(mi: Any) -> None:
    """Make `<bsdf type="merl">` known to Mitsuba's current variant.

    Properties
    ----------
    filename : str
        A `.binary` file of Matusik et al. (2003).
    """

    class MeasuredInMitsuba(mi.BSDF):  # type: ignore[misc]
        def __init__(self, props: Any) -> None:
            super().__init__(props)
            name = props.get("filename")
            path = str(mi.Thread.thread().file_resolver().resolve(name))
            self.counts = np.fromfile(path, "<i4", 3)
            stored = np.fromfile(path, "<f8", offset=12).reshape(3, *self.counts)
            self.f = np.maximum(stored * _SCALES[:, None, None, None], 0.0)
            self._choose_shares()
            front = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [front]
            self.m_flags = front

        def _choose_shares(self) -> None:
            """Find how often each cell of theta_h is chosen, and the cosine instead."""
            count, differences = self.counts[0], self.counts[1]
            self.edges = np.pi / 2 * np.linspace(0, 1, count + 1) ** 2
            middle = (np.arange(differences) + 0.5) * np.pi / 2 / differences
            around = np.sin(2 * middle) / np.sin(2 * middle).sum()
            bright = np.array([0.212671, 0.715160, 0.072169])
            mean = np.einsum("c,chdp,d->h", bright, self.f, around) / self.counts[2]
            light = mean * np.diff(np.sin(self.edges) ** 2)
            light += 1e-3 * light.mean() + np.finfo(float).tiny
            self.shares = light / light.sum()
            below = np.minimum(self.edges, np.pi / 4)
            cosine = np.diff(np.sin(2 * below) ** 2)
            common = np.minimum(cosine, self.shares).sum()
            self.share_of_cosine = min(max(common, 0.1), 0.9)
            self.cumulated = np.concatenate([[0.0], np.cumsum(self.shares)])

        def sample(
            self, ctx: Any, si: Any, sample1: float, sample2: Any, active: bool = True
        ) -> tuple[Any, Any]:
            if sample1 < self.share_of_cosine:
                wo = mi.warp.square_to_cosine_hemisphere(sample2)
            else:
                x, y = np.array(sample2, float)
                k = int(np.searchsorted(self.cumulated, x, "right")) - 1
                k = min(k, len(self.shares) - 1)
                begin, end = np.sin(0.5 * self.edges[k : k + 2]) ** 2
                square = begin + (end - begin) * (x - self.cumulated[k]) / self.shares[k]
                theta, phi = 2 * np.arcsin(np.sqrt(min(square, 1.0))), 2 * np.pi * y
                h = mi.Vector3f(
                    np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)
                )
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
            a, b = np.array(si.wi, float), np.array(wo, float)
            if a[2] <= 0.0 or b[2] <= 0.0:
                return mi.Color3f(0.0), 0.0
            h = (a + b) / np.linalg.norm(a + b)
            theta_h = np.arctan2(np.hypot(h[0], h[1]), h[2])
            k = np.searchsorted(self.edges, theta_h, "right") - 1
            k = min(k, len(self.shares) - 1)
            begin, end = np.sin(0.5 * self.edges[k : k + 2]) ** 2
            by_half = self.shares[k] / (4 * np.pi * (end - begin)) / (4 * np.dot(a, h))
            p = self.share_of_cosine
            pdf = p * b[2] / np.pi + (1 - p) * by_half
            return mi.Color3f(*(self._reflectance(h, theta_h, b) * b[2])), float(pdf)

        def _reflectance(self, h: Any, theta_h: float, direction: Any) -> Any:
            """Return f, interpolated; cells of one corner after the other."""
            phi_h = np.arctan2(h[1], h[0])
            along = np.array([np.cos(phi_h), np.sin(phi_h), 0.0])
            across = np.array([-np.sin(phi_h), np.cos(phi_h), 0.0])
            tangent = np.cos(theta_h) * along - np.sin(theta_h) * np.array([0.0, 0.0, 1.0])
            theta_d = np.arccos(min(np.dot(direction, h), 1.0))
            phi_d = np.arctan2(np.dot(direction, across), np.dot(direction, tangent))
            units = np.array(
                [np.sqrt(theta_h / (np.pi / 2)), theta_d / (np.pi / 2), phi_d / np.pi % 1.0]
            )
            position = units * self.counts - 0.5
            first = np.floor(position).astype(int)
            first[:2] = np.clip(first[:2], 0, self.counts[:2] - 2)
            t = position - first
            t[:2] = np.clip(t[:2], 0.0, 1.0)
            total = np.zeros(3)
            for corner in np.ndindex(2, 2, 2):
                weight = np.prod(np.where(corner, t, 1 - t))
                half, difference, turn = first + corner
                total += weight * self.f[:, half, difference, turn % self.counts[2]]
            return total

        def to_string(self) -> str:
            return f"MeasuredInMitsuba[cells = {list(self.counts)}]"

    mi.register_bsdf("merl", MeasuredInMitsuba)
