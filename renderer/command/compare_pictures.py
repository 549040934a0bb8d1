"""`lightproof --compare A B`: whether two pictures have the same pixels, bit for bit.

A checksum of the files cannot tell: the header of an EXR file holds the command, and so
`--accel` or `--seed`, and how a PNG is packed is nothing that is seen.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.images.exr_image import without_lines_of_openexr

EQUAL = "equal: every pixel and AOV, bit for bit"
Planes = dict[str, NDArray[Any]]  # channel -> (H, W)

_COUNTED = {1: "Y", 3: "RGB", 4: "RGBA"}  # what arrays of so many channels hold


def compare(first: Path, second: Path, *, quiet: bool = False) -> int:
    """Print whether two pictures are equal, or how they differ; return the exit status.

    Returns
    -------
    int
        0 if all bits of all channels are equal, else 1.

    Raises
    ------
    SceneError
        If a file cannot be read, or pictures of another size, other channels or other
        types of numbers make a comparison of pixels meaningless.
    """
    planes, others = read_planes(first), read_planes(second)
    _check_comparable(first, planes, second, others)
    lines = differences(planes, others)
    if not quiet:
        sys.stdout.write("\n".join(lines or [EQUAL]) + "\n")
        sys.stdout.flush()
    return int(bool(lines))


def differences(planes: Planes, others: Planes) -> list[str]:
    """Return how two pictures of the same size and channels differ; nothing if they do not.

    The first line is about all channels, and there is one for each that differs.
    """
    lines, anywhere = [], np.zeros(next(iter(planes.values())).shape, np.bool_)
    for name, plane in planes.items():
        differing = _bits(plane) != _bits(others[name])
        if differing.any():
            anywhere |= differing
            lines.append(f"  {name}: {_largest(plane, others[name], differing)}")
    if lines:
        lines.insert(0, f"different: {int(anywhere.sum())} of {anywhere.size} pixels")
    return lines


def _largest(plane: NDArray[Any], other: NDArray[Any], differing: NDArray[np.bool_]) -> str:
    """Return how many pixels of a channel differ, and the largest difference."""
    ours, theirs = plane.astype(np.float64), other.astype(np.float64)
    with np.errstate(invalid="ignore"):
        by = np.abs(ours - theirs)
    # NaN against a number, or infinity against anything
    by[differing & ~np.isfinite(by)] = np.inf
    by[~differing] = -1.0
    row, column = np.unravel_index(int(by.argmax()), by.shape)
    values = f"{_shown(plane[row, column])} and {_shown(other[row, column])}"
    place = f"column {column}, row {row}: {values}"
    number = int(differing.sum())
    count = f"{number} pixel{'s' if number > 1 else ''}"
    if by.max() == 0.0:
        return f"{count}, in bits that do not change the value, such as at {place}"
    at_most = f", by at most {by.max():.6g}" if np.isfinite(by.max()) else ", such as"
    return f"{count}{at_most} at {place}"


def _shown(value: Any) -> str:
    """Return a number with as many digits as tell it from others of its type."""
    if value.dtype.kind != "f" or not np.isfinite(value):
        return str(value.item())
    if value == 0.0 or 1e-4 <= abs(value) < 1e9:
        return np.format_float_positional(value, trim="0")
    return np.format_float_scientific(value, trim="0")


def _bits(plane: NDArray[Any]) -> NDArray[Any]:
    """Return numbers as what they are made of: NaN is equal to itself, and 0 not to -0."""
    whole = np.ascontiguousarray(plane)
    return whole.view(f"u{whole.dtype.itemsize}")


def _check_comparable(first: Path, planes: Planes, second: Path, others: Planes) -> None:
    """Refuse pictures that have nothing to do with each other, and say what differs."""
    size, other_size = (next(iter(each.values())).shape for each in (planes, others))
    if size != other_size:
        raise SceneError(
            f"{first} has {size[1]} x {size[0]} pixels, {second} has "
            f"{other_size[1]} x {other_size[0]}; equal sizes are needed"
        )
    for path, own, another, foreign in (
        (first, planes, second, others),
        (second, others, first, planes),
    ):
        if more := [name for name in own if name not in foreign]:
            raise SceneError(
                f"{path} has the channels {', '.join(more)}, which {another} has not; "
                f"that has {', '.join(foreign)}"
            )
    for name, plane in planes.items():
        if plane.dtype != others[name].dtype:
            raise SceneError(
                f"{name} is {plane.dtype} in {first} and {others[name].dtype} in {second}; "
                "equal types of numbers are needed"
            )


def read_planes(path: Path) -> Planes:
    """Read the channels of a picture as they are in the file.

    Raises
    ------
    SceneError
        If it is no .exr, .npy or .png, or cannot be read.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        found = f"the ending {path.suffix!r}" if path.suffix else "no ending"
        raise SceneError(f"{path}: {found}; pictures are compared as .exr, .npy or .png")
    if not path.is_file():
        what = "is no regular file" if path.exists() else "no such picture"
        raise SceneError(f"{path}: {what}")
    try:
        planes = reader(path)
    except (SceneError, MemoryError):
        raise
    except Exception as error:  # libraries raise what they like for a damaged file
        reason = (str(error).splitlines() or ["unknown reason"])[0][:200]
        raise SceneError(f"{path}: cannot be read: {reason}") from None
    if not planes or not next(iter(planes.values())).size:
        raise SceneError(f"{path}: there are no pixels in it")
    return planes


def _read_exr(path: Path) -> Planes:
    import OpenEXR

    planes: Planes = {}
    with without_lines_of_openexr(), OpenEXR.File(str(path), True) as file:
        if not file.parts:
            raise SceneError(f"{path}: cannot be read: its pixels are damaged")
        for number, part in enumerate(file.parts):
            layer = f"part {number}." if number else ""
            for name, channel in part.channels.items():
                planes[f"{layer}{name}"] = np.array(channel.pixels)
    shapes = {plane.shape for plane in planes.values()}
    if len(shapes) > 1:
        raise SceneError(
            f"{path}: its channels have sizes {sorted(shapes)}; equal ones are needed"
        )
    return planes


def _read_npy(path: Path) -> Planes:
    array = np.load(path, allow_pickle=False)
    plain = isinstance(array, np.ndarray) and array.dtype.kind in "fiu"
    if not plain or array.dtype.itemsize > 8:
        raise SceneError(f"{path}: holds no array of numbers of 8 to 64 bits")
    array = array.astype(array.dtype.newbyteorder("="))
    return _planes_of(path, array)


def _read_png(path: Path) -> Planes:
    from PIL import Image as pillow

    start = path.read_bytes()[:26]  # what a PNG begins with ends in depth and kind
    if start[24:25] == b"\x10" and start[25:26] != b"\x00":
        raise SceneError(
            f"{path}: a PNG with colours of 16 bits; those of 8 bits can be compared"
        )
    with pillow.open(path, formats=["PNG"]) as image:
        if image.mode in ("P", "1"):  # what colours they are is not in the pixels
            return _planes_of(path, np.asarray(image.convert("RGBA")))
        return _planes_of(path, np.asarray(image))


def _planes_of(path: Path, array: NDArray[Any]) -> Planes:
    """Return the channels of (H, W) or (H, W, C)."""
    if array.ndim == 2:
        array = array[:, :, None]
    if array.ndim != 3:
        raise SceneError(
            f"{path}: an array of shape {array.shape}; expected (height, width, channels)"
        )
    count = array.shape[2]
    names = _COUNTED.get(count, [str(channel) for channel in range(count)])
    return {name: array[:, :, channel] for channel, name in enumerate(names)}


_READERS = {".exr": _read_exr, ".npy": _read_npy, ".png": _read_png}
