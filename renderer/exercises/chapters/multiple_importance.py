"""Two ways of sampling joined into one estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from renderer.exercises.exercise import (
    RIGHT,
    Case,
    Exercise,
    Functions,
    Variants,
    mistakes_of,
)
from renderer.exercises.pictures import scan
from renderer.exercises.vectors import Vector


@dataclass(frozen=True)
class Gaussian:
    """A normal density."""

    mean: float
    sigma: float

    def __call__(self, x: float) -> float:
        """Return the density at x."""
        z = (x - self.mean) / self.sigma
        return math.exp(-0.5 * z * z) / (self.sigma * math.sqrt(2.0 * math.pi))


@dataclass(frozen=True)
class Uniform:
    """The density of numbers that are equally likely between two others."""

    low: float
    high: float

    def __call__(self, x: float) -> float:
        """Return the density at x."""
        return 1.0 / (self.high - self.low) if self.low <= x < self.high else 0.0


@dataclass(frozen=True)
class Product:
    """A product of two functions."""

    a: Callable[[float], float]
    b: Callable[[float], float]

    def __call__(self, x: float) -> float:
        """Return the product at x."""
        return self.a(x) * self.b(x)


def mis_estimate(
    f: Callable[[float], float],
    pdf_a: Callable[[float], float],
    pdf_b: Callable[[float], float],
    samples_a: Sequence[float],
    samples_b: Sequence[float],
    *,
    variants: Variants = RIGHT,
) -> float:
    """Return an estimate of the integral of f, from samples of two densities.

    Parameters
    ----------
    f : function
        f(x) is the value to integrate; x is a float.
    pdf_a, pdf_b : function
        The two densities, pdf_a(x) and pdf_b(x).
    samples_a, samples_b : list of float
        Independent samples, those of a with density pdf_a and those of b with density
        pdf_b. The lists may have different lengths; one of them may be empty.

    Returns
    -------
    float
        The estimate by multiple importance sampling. The weights are those of the power
        heuristic with exponent 2, or of the balance heuristic.
    """
    n_a, n_b = len(samples_a), len(samples_b)

    def weight(own: float, other: float, n_own: int, n_other: int) -> float:
        if "no-counts" in variants:
            n_own = n_other = 1
        a, b = n_own * own, n_other * other
        if "balance" not in variants:
            a, b = a * a, b * b
        if "counts-not-squared" in variants:
            a, b = n_own * own * own, n_other * other * other
        if "exchanged" in variants:
            a, b = b, a
        if "no-weights" in variants:
            return 1.0
        if "halves" in variants:
            return 0.5
        return a / (a + b)

    found = 0.0
    for k, (samples, n) in enumerate(((samples_a, n_a), (samples_b, n_b))):
        total = 0.0
        for x in samples:
            p, q = pdf_a(x), pdf_b(x)
            w = weight(p, q, n_a, n_b) if k == 0 else weight(q, p, n_b, n_a)
            density = p if k == 0 else q
            if "other-pdf" in variants:
                density = p + q - density
            if "sum-of-pdfs" in variants:
                density = p + q
            if "no-pdf" in variants:
                density = 1.0
            total += w * f(x) / density
        if "only-a" in variants and k == 1:
            continue
        count = n_a + n_b if "all-counts" in variants else n
        found += total if "not-mean" in variants else total / max(count, 1)
    return found


def _mis_cases(random: Generator) -> Iterator[Case]:
    wide, narrow = Gaussian(0.0, 1.0), Gaussian(0.5, 0.2)
    both = Product(wide, narrow)
    for about, samples in (
        ("one sample of each density", ([0.3], [0.6])),
        ("one sample of the first density, none of the second", ([0.3], [])),
        ("one sample of the second density, none of the first", ([], [0.6])),
        ("three samples and one", ([0.3, -1.0, 0.8], [0.6])),
    ):
        yield Case(about, "mis_estimate", (both, wide, narrow, *samples))
    left, right = Uniform(0.0, 1.0), Uniform(0.5, 2.5)
    cut = (Product(left, left), left, right, [0.2], [0.7, 1.5])
    yield Case("a sample where the other density is 0", "mis_estimate", cut)
    for _ in range(80):
        a = Gaussian(random.normal(), random.uniform(0.2, 2.0))
        b = Gaussian(random.normal(), random.uniform(0.2, 2.0))
        n_a, n_b = random.integers(1, 5, 2)
        samples = (
            random.normal(a.mean, a.sigma, n_a).tolist(),
            random.normal(b.mean, b.sigma, n_b).tolist(),
        )
        arguments = (Product(a, b), a, b, *samples)
        yield Case("random densities and samples", "mis_estimate", arguments)


def _mis_picture(f: Functions) -> Vector:
    """Draw the estimate over the integral: grey without noise."""
    random = np.random.default_rng(7)

    def colour(x: float, y: float) -> Vector:
        light, bsdf = Gaussian(0.0, 10.0 ** (x - 1.0)), Gaussian(0.02, 10.0 ** (y - 1.0))
        integral = Gaussian(0.02, math.hypot(light.sigma, bsdf.sigma))(0.0)
        samples = (
            random.normal(light.mean, light.sigma, 8).tolist(),
            random.normal(bsdf.mean, bsdf.sigma, 8).tolist(),
        )
        found = f.mis_estimate(Product(light, bsdf), light, bsdf, *samples)
        return np.full(3, 0.5 * found / integral)

    return scan(colour)


MIS = Exercise(
    name="mis",
    summary="Two densities and one integral: multiple importance sampling",
    task="""
        Light can be sampled at the lamps or by the material; each is bad where the other is
        good. Divide each sample by its own density, as always, and multiply it with a
        weight. At each x the weights of both densities have the sum 1.

        In the picture to reach the light is wider from left to right, and the material
        rougher from bottom to top. The estimate over the integral is drawn: grey is
        right.""",
    source="Veach, Robust Monte Carlo Methods for Light Transport Simulation, 1997, "
    "chapter 9 [Veach1997]",
    functions=(mis_estimate,),
    hints=(
        "The estimate is the mean of w_a f / pdf_a over the samples of a, plus the mean of "
        "w_b f / pdf_b over those of b.",
        "The balance heuristic is w_a = n_a pdf_a / (n_a pdf_a + n_b pdf_b), with the "
        "numbers of samples n_a and n_b.",
        "The power heuristic squares each of the products n pdf.",
    ),
    mistakes=mistakes_of("""
        no-weights: Both estimates are added without weights: all counts twice. | Multiply
            each sample with its weight.
        halves: The mean of both estimates is right on average, but it keeps the noise of
            the worse one. | Weights depend on x: n_a pdf_a / (n_a pdf_a + n_b pdf_b).
        exchanged: The weights are exchanged. | A sample has a large weight where its own
            density is large.
        no-counts: The numbers of samples are missing in the weights. | Multiply each
            density by its number of samples.
        counts-not-squared: The densities are squared, but not the numbers of samples. |
            The power heuristic squares n pdf.
        other-pdf: The sample is divided by the other density. | Divide it by the density
            that it was drawn from.
        sum-of-pdfs: The sample is divided by the sum of the densities. | Divide it by the
            density that it was drawn from: the weight has the sum already.
        no-pdf: The sample is not divided by its density. | w f / pdf.
        not-mean: The samples are added, and their mean is not taken. | Divide by the
            number of samples of that density.
        all-counts: Both sums are divided by the number of all samples. | Divide each by
            the number of its own samples.
        only-a: The samples of the second density are not used. | Add both means.
        """),
    cases=_mis_cases,
    picture=_mis_picture,
    conventions=("balance",),
)

EXERCISES = (MIS,)
