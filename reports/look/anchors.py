"""Where a scene stands on a page: the same id on every page."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mitsuba_ref.records.results import SceneResult


def scene_anchors(scenes: Sequence[SceneResult]) -> list[str]:
    """Return an id for each scene's section, no two alike."""
    anchors: list[str] = []
    for scene in scenes:
        slug = re.sub(r"[^a-z0-9]+", "-", scene.name.lower()).strip("-") or "scene"
        anchor, count = f"scene-{slug}", 2
        while anchor in anchors:
            anchor, count = f"scene-{slug}-{count}", count + 1
        anchors.append(anchor)
    return anchors
