"""Position of the sun: a direction given in the file, or from place and time."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

_TIMES = {  # smallest and largest value of each property
    "latitude": (-90.0, 90.0),
    "longitude": (-360.0, 360.0),
    "timezone": (-24.0, 24.0),
    "year": (1, 9999),
    "month": (1, 12),
    "day": (1, 31),
    "hour": (0.0, 24.0),
    "minute": (0.0, 60.0),
    "second": (0.0, 60.0),
}


class Moment(NamedTuple):
    """Place and time; the defaults are Mitsuba's."""

    latitude: float = 35.6894  # [deg]
    longitude: float = 139.6917  # [deg] east
    timezone: float = 9.0  # [h]
    year: int = 2010
    month: int = 7
    day: int = 10
    hour: float = 15.0
    minute: float = 0.0
    second: float = 0.0


def sun_at(when: Moment) -> NDArray[np.float64]:
    """Return the unit direction to the sun: +x is south, -y is east, +z is up.

    The formulas are those of [BlancoMuriel2001] in single precision, with the fused
    multiply-adds of Mitsuba's wheels. There the Julian date has steps of a quarter of a
    day, which moves the unit vector by up to 8e-4. For 300 dates the median difference from
    Mitsuba's direction is 2e-7; the largest, where a sine rounds differently, is 1.5e-5.
    """
    f = np.float32
    hours = f(when.hour) - f(when.timezone)
    hours = hours + (f(when.minute) + f(when.second) / f(60)) / f(60)
    january = _quotient(when.month - 14, 12)
    number = _quotient(1461 * (when.year + 4800 + january), 4)
    number += _quotient(367 * (when.month - 2 - 12 * january), 12)
    number -= _quotient(3 * _quotient(when.year + 4900 + january, 100), 4)
    number += when.day - 32075
    days: Any = f(number) - f(0.5) + hours / f(24) - f(2451545)

    omega = _sum(2.1429, -0.0010394594, days)
    anomaly = _sum(6.2400600, 0.0172019699, days)
    longitude = _sum(4.8950630, 0.017202791698, days)
    longitude = _sum(longitude, 0.03341607, np.sin(anomaly))
    longitude = _sum(longitude, 0.00034894, np.sin(f(2) * anomaly)) - f(0.0001134)
    longitude = _sum(longitude, -0.0000203, np.sin(omega))
    obliquity = _sum(_sum(0.4090928, -6.2140e-9, days), 0.0000396, np.cos(omega))
    ascension = np.arctan2(np.cos(obliquity) * np.sin(longitude), np.cos(longitude))
    ascension = ascension + (f(2.0 * math.pi) if ascension < 0 else f(0))
    declination = np.arcsin(np.sin(obliquity) * np.sin(longitude))

    degree = f(math.pi / 180.0)
    sidereal = _sum(6.6974243242, 0.0657098283, days) + hours
    angle = _sum(when.longitude, 15.0, sidereal) * degree - ascension
    latitude = f(when.latitude) * degree
    sine, cosine = np.sin(latitude), np.cos(latitude)
    height = np.sin(declination) * sine
    height = _sum(height, cosine * np.cos(angle), np.cos(declination))
    theta = np.arccos(np.clip(height, f(-1), f(1)))
    along = _sum(-(sine * np.cos(angle)), np.tan(declination), cosine)
    phi = float(np.arctan2(-np.sin(angle), along) - f(math.pi))
    # parallax: the radius of the Earth over the distance of the sun
    t = float(_sum(theta, 6371.01 / 149597890, np.sin(theta)))
    return np.array([math.sin(t) * math.cos(phi), math.sin(t) * math.sin(phi), math.cos(t)])


def _sum(a: Any, b: Any, c: Any) -> Any:
    """Return a + b c in float32, rounded once."""
    f = np.float32
    return f(float(f(a)) + float(f(b)) * float(f(c)))


def _quotient(a: int, b: int) -> int:
    """Divide towards zero, as C does."""
    return int(a / b)


def read_sun_direction(properties: Any, to_world: Any) -> tuple[float, float, float]:
    """Return the world space unit direction to the sun, given or from place and time."""
    defaults, values = Moment(), {}
    given = [name for name in _TIMES if properties.has(name)]
    for name, (least, most) in _TIMES.items():
        reader = properties.integer if isinstance(least, int) else properties.number
        default = getattr(defaults, name)
        values[name] = reader(name, default, at_least=least, at_most=most)
    if not properties.has("sun_direction"):
        sun = to_world[:3, :3] @ sun_at(Moment(**values))
    elif given:
        properties.fail(given[0], 'a value together with "sun_direction"', "one of the two")
    else:
        sun = np.array(properties.vector("sun_direction", None))
        if not sun.any():
            properties.fail("sun_direction", "the zero vector", "a direction")
        sun = sun / np.abs(sun).max()  # squares neither underflow nor overflow
    x, y, z = (float(value) for value in sun / np.linalg.norm(sun))
    return x, y, z
