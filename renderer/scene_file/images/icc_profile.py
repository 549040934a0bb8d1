"""Whether an ICC profile means anything else than sRGB.

Only profiles of three primaries and curves, or of one curve for grey, are looked into; of
others, such as tables, the answer is that they differ. Nothing is converted: Mitsuba takes
pixels as sRGB whatever their profile.
"""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.images.image import linear_from_srgb

# sRGB's red, green and blue in XYZ under D50, as its profiles have them.
_PRIMARIES = {
    b"rXYZ": (0.4361, 0.2225, 0.0139),
    b"gXYZ": (0.3851, 0.7169, 0.0971),
    b"bXYZ": (0.1431, 0.0606, 0.7141),
}
_CLOSE = 0.004  # difference of XYZ; profiles of sRGB differ by less among themselves
_SAME_CURVE = 0.01  # of linear light in [0, 1]; the power 2.2 is as close
_HEADER = 128  # [bytes]
_POINTS = np.linspace(0.0, 1.0, 33)


def differs_from_srgb(profile: bytes) -> bool:
    """Tell whether colours of this profile are other colours than those of sRGB.

    True too for a profile that is damaged.
    """
    try:
        (count,) = struct.unpack_from(">I", profile, _HEADER)
        tags = {}
        for i in range(min(count, 200)):
            name, at, size = struct.unpack_from(">4sII", profile, _HEADER + 4 + 12 * i)
            tags[name] = profile[at : at + size]
        if profile[16:20] == b"GRAY":
            return _curve_differs(tags[b"kTRC"])
        if b"A2B0" in tags:
            return True
        for name, expected in _PRIMARIES.items():
            found = np.array(struct.unpack_from(">3i", tags[name], 8)) / 65536.0
            if np.abs(found - expected).max() > _CLOSE:
                return True
        return any(_curve_differs(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC"))
    except (struct.error, KeyError, ValueError):
        return True


def _curve_differs(tag: bytes) -> bool:
    with np.errstate(all="ignore"):
        difference = np.abs(_curve(tag) - linear_from_srgb(_POINTS)).max()
    return not difference < _SAME_CURVE


def _curve(tag: bytes) -> NDArray[np.float64]:
    """Return the linear light of the points of [0, 1].

    Raises
    ------
    struct.error, ValueError
        If it is damaged, or a curve of another kind.
    """
    kind, first = struct.unpack_from(">4s4xI", tag)
    if kind == b"curv" and first == 0:
        return _POINTS
    if kind == b"curv" and first == 1:
        (power,) = struct.unpack_from(">H", tag, 12)
        return np.asarray(_POINTS ** (power / 256.0))
    if kind == b"curv":
        table = np.frombuffer(tag, ">u2", first, 12) / 65535.0
        return np.interp(_POINTS, np.linspace(0.0, 1.0, first), table)
    if kind == b"para" and first >> 16 == 0:
        (power,) = struct.unpack_from(">i", tag, 12)
        return np.asarray(_POINTS ** (power / 65536.0))
    if kind == b"para" and first >> 16 == 3:  # a straight line below d
        power, a, b, c, d = np.array(struct.unpack_from(">5i", tag, 12)) / 65536.0
        return np.where(d <= _POINTS, (a * _POINTS + b) ** power, c * _POINTS)
    raise ValueError
