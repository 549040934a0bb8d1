"""Transforms for the dictionaries of `load_dict`: look_at, translate, rotate, scale.

Each returns a (4, 4) matrix that acts on column vectors, so `translate(...) @ rotate(...)`
rotates first. Conventions are those of Mitsuba's `ScalarTransform4f`, against which
tests/renderer/scene_file/test_transform_functions.py compares them.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.transforms import Matrix


def look_at(origin: ArrayLike, target: ArrayLike, up: ArrayLike) -> Matrix:
    """Return world_from_camera of a camera that looks at a point.

    Parameters
    ----------
    origin, target : 3 numbers
        Position of the camera, and a point on its +z axis.
    up : 3 numbers
        Direction of any length; the +y axis is as near to it as possible, and the +x axis
        points to the left.

    Returns
    -------
    float64 (4, 4)
        A rotation and translation: the frame is right-handed and its axes have length 1.

    Raises
    ------
    SceneError
        If an argument is not three finite numbers, `target` is `origin`, or `up` is 0 or
        parallel to the view.
    """
    place, point = (
        _triple("look_at", "origin", origin),
        _triple("look_at", "target", target),
    )
    upward = _triple("look_at", "up", up)
    if not any(upward):
        raise SceneError("look_at: up is 0; possible is a direction, such as (0, 1, 0)")
    matrix = transforms.look_at(place, point, upward)
    if matrix is None:
        raise SceneError(
            f"look_at: there is no view from origin {_shown(place)} to target "
            f"{_shown(point)} with up {_shown(upward)}: target must differ from origin, "
            "and up must not be parallel to the view"
        )
    return matrix


def translate(v: ArrayLike) -> Matrix:
    """Return the translation by three numbers, a float64 (4, 4) matrix.

    Raises
    ------
    SceneError
        If `v` is not three finite numbers.
    """
    return transforms.translate(*_triple("translate", "v", v))


def rotate(axis: ArrayLike, angle: float) -> Matrix:
    """Return the rotation about an axis through the origin, a float64 (4, 4) matrix.

    Parameters
    ----------
    axis : 3 numbers
        Of length 1. As in Mitsuba it is not normalised: any other length distorts, which
        is logged as a warning by the logger "renderer".
    angle : float
        [degrees], counter-clockwise, looking from the axis's tip to the origin.

    Raises
    ------
    SceneError
        If `axis` is not three finite numbers or is 0, or `angle` is not a finite number.
    """
    direction = _triple("rotate", "axis", axis)
    if not any(direction):
        raise SceneError("rotate: the axis is 0; possible is a direction of length 1")
    degrees = _numbers("rotate", "angle", angle, "a finite number, in degrees")
    if degrees.shape != ():
        raise _refused("rotate", "angle", angle, "a finite number, in degrees")
    if (warning := transforms.why_distorting(direction)) is not None:
        logging.getLogger("renderer").warning("rotate: the axis %s", warning)
    return transforms.rotate(direction, float(degrees))


def scale(v: ArrayLike) -> Matrix:
    """Return the scaling by one number, or by one for each axis: a float64 (4, 4) matrix.

    Raises
    ------
    SceneError
        If `v` is neither one finite number nor three.
    """
    factors = _numbers("scale", "v", v, "one finite number, or three")
    if factors.shape not in ((), (3,)):
        raise _refused("scale", "v", v, "one finite number, or three")
    return transforms.scale(*np.broadcast_to(factors, 3))


def _triple(function: str, name: str, value: ArrayLike) -> list[float]:
    numbers = _numbers(function, name, value, "three finite numbers")
    if numbers.shape != (3,):
        raise _refused(function, name, value, "three finite numbers")
    found: list[float] = numbers.tolist()
    return found


def _numbers(function: str, name: str, value: ArrayLike, possible: str) -> np.ndarray:
    """Return an argument as a float64 array of finite numbers, of any shape."""
    try:
        given = np.asarray(value)
        # a string is not a number, although NumPy would convert "1"
        if given.dtype.kind in "iuf" or given.dtype == object:
            numbers = given.astype(np.float64)
            if np.isfinite(numbers).all():
                return numbers
    except (TypeError, ValueError, OverflowError):
        pass
    raise _refused(function, name, value, possible)


def _refused(function: str, name: str, value: Any, possible: str) -> SceneError:
    found = " ".join(repr(value).split())
    found = found if len(found) <= 60 else f"{found[:60]}..."
    return SceneError(f"{function}: {name} is {found}; possible is {possible}")


def _shown(vector: list[float]) -> str:
    return f"({', '.join(f'{number:g}' for number in vector)})"
