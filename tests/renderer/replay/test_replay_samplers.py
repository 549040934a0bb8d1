"""The numbers of Mitsuba's samplers, drawn by our kernels: every bit of every number.

Rationale: a replay follows Mitsuba's paths only if each draw gives the same float; one
wrong bit in a key or a permutation gives another picture that looks as good. Setup: the
installed Mitsuba's own samplers compared with our records, with the same seeds, through
mixed programs of `next_1d` and `next_2d`. Expectation: equal bits, no tolerance.
"""

from __future__ import annotations

import math

import mitsuba as mi
import numpy as np
import pytest
from scene_file_samples import error_of, ours, theirs

from renderer.errors import NotReplayable
from renderer.kernels.jit import entry_kernel
from renderer.replay.numbers import (
    encrypt,
    next_float,
    next_u32,
    pcg32_seed,
    permute_any_size,
    permute_power_of_two,
    tea,
)
from renderer.replay.samplers import sobol, van_der_corput
from renderer.replay.sequences import MAKERS, begin_sample, make_sequence, next_1d, next_2d
from renderer.scene_file.description import Sampler
from renderer.scene_file.objects.films import round_sample_count

SEEDS = np.array([0, 1, 31, 65537, 2**31 + 5, 2**32 - 1], np.uint32)
OWN_SEEDS = (0, 9, 2**32 - 2)  # the last one makes the sum with a pixel's seed overflow
COUNTS = (1, 2, 3, 4, 7, 16, 25, 40, 64, 121, 250, 256)
WITH_JITTER = ("stratified", "multijitter", "orthogonal")
ORTHOGONAL = """<sensor type="perspective"><float name="fov" value="40"/>
<sampler type="orthogonal"><integer name="sample_count" value="25"/>
<integer name="strength" value="{}"/></sampler></sensor>"""
KEYS = (0, 1, 0xDEADBEEF, 2**31, 2**32 - 1, 12345, 0x45FBE943)


# -------------------------------------------------------------------------- generator


class PlainPcg32:
    """PCG32 in Python integers, with a stream, after [ONeill2014]: the slow truth."""

    def __init__(self, seed: int, stream: int) -> None:
        self.increment = (2 * stream + 1) % 2**64
        self.state = 0
        self.next_u32()
        self.state = (self.state + seed) % 2**64
        self.next_u32()

    def next_u32(self) -> int:
        old = self.state
        self.state = (old * 6364136223846793005 + self.increment) % 2**64
        word = ((old ^ (old >> 18)) >> 27) % 2**32
        turn = old >> 59
        return (word >> turn | word << (32 - turn)) % 2**32


@entry_kernel
def run_generator(state, bits, floats):
    for i in range(bits.shape[1]):
        for pixel in range(state.size):
            bits[pixel, i] = next_u32(state, pixel)
    for i in range(floats.shape[1]):
        for pixel in range(state.size):
            floats[pixel, i] = next_float(state, pixel)


def test_plain_pcg32_gives_the_published_numbers() -> None:
    """The first six of the demo program of the PCG library, seed 42 and stream 54."""
    plain = PlainPcg32(42, 54)
    assert [plain.next_u32() for _ in range(6)] == [
        0xA15C02B7,
        0x7B47F409,
        0xBA1D3330,
        0x83D2F293,
        0xBFA4784B,
        0xCBED606E,
    ]


def test_generators_are_pcg32_on_the_default_stream() -> None:
    """Kernels, the slow truth and Mitsuba's own generator agree on bits and floats."""
    seeds = [0, 1, 42, 2**32 - 1, 2**63 + 7]
    state = pcg32_seed(np.array(seeds, np.uint64))
    bits = np.empty((len(seeds), 64), np.uint32)
    floats = np.empty((len(seeds), 64), np.float32)
    run_generator(state, bits, floats)
    for seed, own_bits, own_floats in zip(seeds, bits, floats, strict=True):
        plain = PlainPcg32(seed, 0xDA3E39CB94B95BDB)
        assert [plain.next_u32() for _ in range(64)] == own_bits.tolist()
        generator = mi.PCG32(initstate=seed)
        assert [generator.next_uint32() for _ in range(64)] == own_bits.tolist()
        assert [generator.next_float32() for _ in range(64)] == own_floats.tolist()


# ----------------------------------------------------------- permutations and bit tricks


@entry_kernel
def run_permutations(indices, sizes, keys, any_size, power_of_two):
    for i in range(indices.size):
        any_size[i] = permute_any_size(indices[i], sizes[i], keys[i])
        if sizes[i] & (sizes[i] - np.uint64(1)) == np.uint64(0):
            power_of_two[i] = permute_power_of_two(indices[i], sizes[i], keys[i])


@entry_kernel
def run_bits(indices, scrambles, first, second, inverse, sobol_2):
    for i in range(indices.size):
        first[i], second[i] = tea(indices[i], scrambles[i], 4)
        inverse[i] = van_der_corput(indices[i], scrambles[i])
        sobol_2[i] = sobol(indices[i], scrambles[i])


def permuted(indices, sizes, keys):
    asked = [np.asarray(column, np.uint64) for column in (indices, sizes, keys)]
    any_size, power_of_two = np.empty((2, asked[0].size), np.uint64)
    run_permutations(*asked, any_size, power_of_two)
    return any_size, power_of_two


def test_permutations_are_those_of_mitsuba() -> None:
    """Both kinds, every place of many sizes; each one is a permutation.

    Except that Kensler's, in 32 bits, is none for the last key: places overflow.
    """
    cases = [(size, key) for size in (*range(1, 20), 64, 97, 121, 256) for key in KEYS]
    rows = [(i, size, key) for size, key in cases for i in range(size)]
    any_size, power_of_two = permuted(*zip(*rows, strict=True))
    start = 0
    for size, key in cases:
        part = slice(start, start + size)
        start += size
        places = [mi.permute_kensler(i, size, key) for i in range(size)]
        assert any_size[part].tolist() == places
        assert sorted(places) == list(range(size)) or key == 2**32 - 1
        if size & (size - 1) == 0:
            places = [mi.permute(i, size, key, 2) for i in range(size)]
            assert power_of_two[part].tolist() == places
            assert sorted(places) == list(range(size))


def test_a_walk_from_outside_a_permutation_ends() -> None:
    """Where Mitsuba walks for ever among numbers that are too large, ours stops."""
    rows = [(i, size, key) for size in (3, 5, 9) for key in range(200) for i in range(16)]
    any_size, _ = permuted(*zip(*rows, strict=True))
    sizes = np.array([size for _, size, _ in rows], np.uint64)
    assert (any_size < sizes).all()


def test_cipher_and_radical_inverses_are_those_of_mitsuba() -> None:
    """32-bit words from end to end; Sobol's number is rounded to 1 where it is large."""
    rng = np.random.default_rng(4)
    indices, scrambles = rng.integers(0, 2**32, (2, 500), dtype=np.uint64)
    indices[:3], scrambles[:3] = (0, 2**32 - 1, 0), (0, 0, 2**32 - 1)
    first, second = np.empty((2, indices.size), np.uint64)
    inverse, sobol_2 = np.empty((2, indices.size), np.float32)
    run_bits(indices, scrambles, first, second, inverse, sobol_2)
    arrays = encrypt(indices, scrambles, 4)
    assert np.array_equal(arrays[0], first)
    assert np.array_equal(arrays[1], second)
    for i, (index, scramble) in enumerate(
        zip(indices.tolist(), scrambles.tolist(), strict=True)
    ):
        assert (first[i], second[i]) == tuple(mi.sample_tea_32(index, scramble))
        assert inverse[i] == mi.radical_inverse_2(index, scramble)
        assert sobol_2[i] == mi.sobol_2(index, scramble)
    assert sobol_2[2] == 1.0


# --------------------------------------------------------------------------- sequences


@entry_kernel
def run_program(sequence, program, out):
    """Draw one sample of all pixels after the other; `program` says how many numbers."""
    for sample in range(program.shape[0]):
        for pixel in range(out.shape[0]):
            begin_sample(sequence, pixel)
            place = 0
            for step in range(program.shape[1]):
                if program[sample, step] == 1:
                    out[pixel, sample, place] = next_1d(sequence, pixel, sample)
                elif program[sample, step] == 2:
                    x, y = next_2d(sequence, pixel, sample)
                    out[pixel, sample, place] = x
                    out[pixel, sample, place + 1] = y
                place += program[sample, step]


def make_program(samples: int, steps: int = 9) -> np.ndarray:
    """Return random numbers of draws, (samples, steps) of 0, 1, 2; each row differs."""
    return np.random.default_rng(samples).integers(0, 3, (samples, steps))


def our_numbers(sampler: Sampler, program: np.ndarray) -> np.ndarray:
    out = np.full((SEEDS.size, program.shape[0], 2 * program.shape[1]), -1, np.float32)
    run_program(make_sequence(SEEDS, sampler), program, out)
    return out


def their_numbers(sampler: Sampler, program: np.ndarray) -> np.ndarray:
    """Draw pixel by pixel, as Mitsuba's render loop does, from a fork as it does."""
    properties = {"type": sampler.name, "sample_count": sampler.sample_count}
    properties["seed"] = sampler.seed
    if sampler.name in WITH_JITTER:
        properties["jitter"] = sampler.jitter
    if sampler.name == "orthogonal":
        properties["strength"] = sampler.strength
    drawn = mi.load_dict(properties).fork()
    out = np.full((SEEDS.size, program.shape[0], 2 * program.shape[1]), -1, np.float32)
    for row, seed in zip(out, SEEDS.tolist(), strict=True):
        drawn.seed(seed, 1)
        for line, draws in zip(row, program.tolist(), strict=True):
            numbers = []
            for draw in draws:
                if draw == 1:
                    numbers.append(drawn.next_1d())
                elif draw == 2:
                    numbers.extend(drawn.next_2d())
            line[: len(numbers)] = numbers
            drawn.advance()
    return out


def assert_same_numbers(sampler: Sampler, samples: int) -> None:
    program = make_program(samples)
    own = our_numbers(sampler, program)
    expected = their_numbers(sampler, program)
    assert np.array_equal(own.view(np.uint32), expected.view(np.uint32)), sampler
    used = own[own >= 0]
    assert used.size == SEEDS.size * program.sum()
    # without jitter few numbers are different; with it, nearly all are
    if sampler.jitter and samples > 1:
        assert np.unique(used).size > used.size // 20


@pytest.mark.parametrize(
    ("name", "jitter"),
    [*((name, True) for name in MAKERS), *((name, False) for name in WITH_JITTER)],
)
def test_all_numbers_are_those_of_mitsuba(name: str, jitter: bool) -> None:
    """All samples of pixels with many seeds, for many sample counts, rounded or not."""
    for asked in COUNTS:
        samples = round_sample_count(name, asked)
        for own in OWN_SEEDS:
            assert_same_numbers(Sampler(name, asked, own, jitter), samples)


@pytest.mark.parametrize("strength", [3, 4, 7])
def test_orthogonal_arrays_of_more_strength(strength: int) -> None:
    """Another construction than that of strength 2, with Mitsuba's slip in its digits."""
    for asked in (4, 9, 25, 121):
        assert_same_numbers(Sampler("orthogonal", asked, 9, True, strength), asked)


@pytest.mark.parametrize("name", list(MAKERS))
def test_exhausted_patterns_go_on_as_in_mitsuba(name: str) -> None:
    """Three times as many samples as the pattern has, of sizes at which Mitsuba ends."""
    count = 25 if name == "orthogonal" else 16
    assert_same_numbers(Sampler(name, count, 5), 3 * count)


# ------------------------------------------------------------------------- the borders


def test_a_file_says_the_strength_of_orthogonal_arrays() -> None:
    """Mitsuba takes it too. It hangs at 1 and divides by zero at 0: those are errors."""
    text = ORTHOGONAL.format(3)
    assert ours("", sensor=text).camera.sampler == Sampler("orthogonal", 25, strength=3)
    theirs("", sensor=text)
    for strength in (0, 1):
        message = error_of("", sensor=ORTHOGONAL.format(strength))
        assert message.startswith("<string>:5: ")
        assert f"found {strength}, expected" in message


def test_too_large_an_orthogonal_array_is_refused() -> None:
    """11^10 overflows 32 bits: Mitsuba's array would be of another size, or none."""
    with pytest.raises(NotReplayable, match=r"strength 10 with 121 samples.*11\^10"):
        make_sequence(SEEDS, Sampler("orthogonal", 121, strength=10))


def test_counts_of_multijitter_survive_the_square_root_in_float32() -> None:
    """Mitsuba takes it in float32, ours in integers: equal up to the largest count.

    The dangerous ones lie just below a square and just at it.
    """
    for root in range(2, 4097):
        for count in (root * root - 1, root * root, root * root + 1):
            if count <= 2**24:
                assert int(np.sqrt(np.float32(count))) == math.isqrt(count)


def test_large_counts_are_rounded_as_in_mitsuba() -> None:
    for name in MAKERS:
        for count in (4095, 16000, 2**20 - 1, 2**24 - 3):
            expected = mi.load_dict({"type": name, "sample_count": count}).sample_count()
            assert round_sample_count(name, count) == expected
