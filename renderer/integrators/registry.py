"""All integrators. Each file named after an integrator defines its `INTEGRATOR`."""

from __future__ import annotations

import importlib
from typing import Any

from renderer.integrators.kind import IntegratorKind
from renderer.integrators.moment import MOMENT
from renderer.process import names

INTEGRATORS: dict[str, IntegratorKind] = {
    name: importlib.import_module(f"renderer.integrators.{name}").INTEGRATOR
    for name in names.INTEGRATORS
    if name != "auto"
}
IN_FILES: dict[str, Any] = {
    name: kind for name, kind in INTEGRATORS.items() if kind.read is not None
} | {"moment": MOMENT}
