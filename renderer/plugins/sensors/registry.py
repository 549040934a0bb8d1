"""Registers all kinds of sensor."""

from __future__ import annotations

from renderer.plugins.sensors.kind import SensorKind
from renderer.plugins.sensors.orthographic import ORTHOGRAPHIC
from renderer.plugins.sensors.perspective import PERSPECTIVE
from renderer.plugins.sensors.thinlens import THIN_LENS

SENSORS: dict[str, SensorKind] = {
    kind.name: kind for kind in (PERSPECTIVE, THIN_LENS, ORTHOGRAPHIC)
}


def kind_of_sensor(sensor: object) -> SensorKind:
    """Return the kind of a sensor of the description."""
    return next(kind for kind in SENSORS.values() if kind.description is type(sensor))
