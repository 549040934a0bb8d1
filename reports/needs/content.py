"""What a scene's files hold: whether an earlier measurement is of the same scene."""

from __future__ import annotations

import hashlib
from pathlib import Path

from renderer.scene.scene import Scene


def content_of(scene: Scene) -> str:
    """Return a hash of every file that the scene reads, itself among them.

    Of the paths only the last names count, so that a clone elsewhere has the same.
    """
    digest = hashlib.sha256()
    for file in map(Path, scene.description.files):
        content = file.read_bytes()
        digest.update(f"{file.name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()[:32]
