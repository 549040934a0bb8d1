"""All kinds of shape: importing them makes their kernels known."""

from __future__ import annotations

import renderer.lights.spheres
import renderer.shapes.cylinder
import renderer.shapes.disk
import renderer.shapes.rectangle
import renderer.shapes.triangle  # noqa: F401
