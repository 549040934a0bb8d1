"""Films, reconstruction filters and samplers of a document."""

from __future__ import annotations

import math

from renderer.errors import SceneError
from renderer.scene_file.description import Film, ReconstructionFilter, Sampler
from renderer.scene_file.files import Reading
from renderer.scene_file.properties import Properties
from renderer.scene_file.tree import Element

# -------------------------------------------------------------------------------- films
# The film: size, crop window and reconstruction filter.

# Pixels of the crop window: samplers number them in 32 bits. Whether they fit into memory
# is checked before the render.
_LARGEST = 2**32
_LONGEST = 2**20  # pixels of a side
_PIXELS = ("rgb", "rgba", "luminance", "luminance_alpha", "xyz", "xyza")


def read_film(element: Element | None, reading: Reading) -> Film:
    """Read a `<film>`; None is the default one, 768 x 576 with a gaussian filter.

    Raises
    ------
    SceneError
        If it is not supported or the crop window does not fit.
    """
    if element is None:
        return Film()
    properties = Properties(element, reading)
    width = properties.integer("width", 768, at_least=1, at_most=_LONGEST)
    height = properties.integer("height", 576, at_least=1, at_most=_LONGEST)
    crop_width, crop_offset_x = _crop(properties, "width", "x", width)
    crop_height, crop_offset_y = _crop(properties, "height", "y", height)
    if crop_width * crop_height > _LARGEST:
        raise SceneError(
            f"{element.location}: {element} has {crop_width} x {crop_height} pixels; "
            f"expected at most {_LARGEST}"
        )
    _file_properties(properties)
    sample_border = properties.boolean("sample_border", False)
    nested = properties.child("rfilter")
    rfilter = ReconstructionFilter() if nested is None else read_rfilter(nested, reading)
    properties.finish()
    return Film(
        width,
        height,
        crop_offset_x,
        crop_offset_y,
        crop_width,
        crop_height,
        rfilter,
        sample_border,
    )


def _crop(properties: Properties, side: str, axis: str, size: int) -> tuple[int, int]:
    """Return length and offset of the crop window along one axis."""
    length = properties.integer(f"crop_{side}", size, at_least=1)
    offset = properties.integer(f"crop_offset_{axis}", 0, at_least=0)
    if offset + length > size:
        name = f"crop_{side}" if properties.has(f"crop_{side}") else f"crop_offset_{axis}"
        properties.fail(
            name,
            f"a crop window from {offset} to {offset + length}",
            f"one inside of the film's {side}, 0 to {size}",
        )
    return length, offset


def _file_properties(properties: Properties) -> None:
    """Check the properties for Mitsuba's storage of the picture.

    They do not affect this renderer's picture, which is linear sRGB in float32. The name of
    the output file selects its format.
    """
    properties.choice(
        "file_format", "openexr", ("openexr", "exr", "pfm", "rgbe"), any_case=True
    )
    pixels = properties.choice("pixel_format", "rgb", _PIXELS, any_case=True)
    if pixels not in ("rgb", "rgba"):
        properties.reading.warn(
            properties.element.properties["pixel_format"].location,
            f"{properties.element} names {pixels} pixels; pictures are rgb here",
        )
    properties.choice(
        "component_format", "float16", ("float16", "float32", "uint32"), any_case=True
    )
    properties.boolean("compensate", False)  # for rounding errors of sums: float64 here
    properties.boolean("banner", False)


def read_rfilter(element: Element, reading: Reading) -> ReconstructionFilter:
    """Read an `<rfilter>`.

    Raises
    ------
    SceneError
        If it is not supported or its parameters are invalid.
    """
    properties = Properties(element, reading)
    match element.plugin:
        case "box":
            rfilter = ReconstructionFilter("box", radius=0.5)
        case "tent":
            radius = properties.number("radius", 1.0, above=0.0, at_most=_WIDEST)
            rfilter = ReconstructionFilter("tent", radius)
        case "gaussian":
            stddev = properties.number("stddev", 0.5, above=0.0, at_most=_WIDEST / 4.0)
            rfilter = ReconstructionFilter("gaussian", 4.0 * stddev, stddev)
        case "mitchell":
            b = properties.number("B", 1.0 / 3.0)
            c = properties.number("C", 1.0 / 3.0)
            rfilter = ReconstructionFilter("mitchell", 2.0, b=b, c=c)
        case "catmullrom":
            rfilter = ReconstructionFilter("catmullrom", 2.0)
        case _:
            lobes = properties.integer("lobes", 3, at_least=1, at_most=int(_WIDEST))
            rfilter = ReconstructionFilter("lanczos", float(lobes))
    properties.finish()
    return rfilter


_WIDEST = 64.0  # [pixels]; a wider filter is probably an error, and would be very slow


# ----------------------------------------------------------------------------- samplers
# Samplers by name; each has the number of samples that its pattern allows.

_MOST_SAMPLES = 2**24


def read_sampler(element: Element | None, reading: Reading) -> Sampler:
    """Read a `<sampler>`; None is the default one, `independent` with 4 samples.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    if element is None:
        return Sampler()
    properties = Properties(element, reading)
    name = element.plugin
    requested = properties.integer("sample_count", 4, at_least=1, at_most=_MOST_SAMPLES)
    count = round_sample_count(name, requested)
    if count != requested:
        reading.warn(
            element.location,
            f"{element} rounds {requested} samples up to {count}, as in Mitsuba",
        )
    seed = properties.integer("seed", 0, at_least=0, at_most=2**32 - 1)
    jitter = True
    if name in ("stratified", "multijitter", "orthogonal"):
        jitter = properties.boolean("jitter", True)
    strength = 2
    if name == "orthogonal":
        # Mitsuba divides by zero at 0 and hangs at 1
        strength = properties.integer("strength", 2, at_least=2, at_most=31)
    properties.finish()
    return Sampler(name, count, seed, jitter, strength)


def round_sample_count(sampler: str, count: int) -> int:
    """Return the number of samples per pixel that Mitsuba takes for a `count`.

    Parameters
    ----------
    sampler
        Name of the sampler: `stratified` needs a square, `multijitter` a rectangle,
        `orthogonal` the square of a prime, `ldsampler` a power of four.
    count
        At least 1.
    """
    root = math.isqrt(count - 1) + 1  # the square root, rounded up
    match sampler:
        case "stratified":
            return root * root
        case "multijitter":
            columns = math.isqrt(count)
            return columns * -(-count // columns)
        case "orthogonal":
            prime = max(root, 2)
            while any(prime % divisor == 0 for divisor in range(2, math.isqrt(prime) + 1)):
                prime += 1
            return prime * prime
        case "ldsampler":
            return 4 ** max(1, math.ceil((count - 1).bit_length() / 2))
        case _:
            return count
