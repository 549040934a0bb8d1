"""What the JSON of a glTF file says, without meshes: cameras, lights, what stays behind.

After the Khronos Group's "glTF 2.0 Specification": matrices are column by column, angles
in radians; cameras and lights look along -z; a .glb file has a header of 12 bytes and then
chunks, of which the first is the JSON.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError

_MAGIC = b"glTF"
_LIGHTS = "KHR_lights_punctual"
_STRENGTH = "KHR_materials_emissive_strength"
_KNOWN = {_LIGHTS, _STRENGTH}
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placed:
    """A camera or a light of the file, where a node has it."""

    to_world: Matrix  # (4, 4)
    content: dict[str, Any]  # as the file has it


@dataclass(frozen=True, eq=False)
class GltfHeader:
    """The JSON of a file, or of none."""

    content: dict[str, Any]

    @classmethod
    def of(cls, path: Path) -> GltfHeader:
        """Read the header of a .gltf or .glb file; of another file it is empty.

        Raises
        ------
        SceneError
            If there is none in such a file.
        """
        if path.suffix.lower() not in (".gltf", ".glb"):
            return cls({})
        content = path.read_bytes()
        if content[:4] == _MAGIC and len(content) >= 20:
            (size,) = struct.unpack_from("<I", content, 12)
            content = content[20 : 20 + size]
        try:
            found = json.loads(content)
        except ValueError:
            found = None
        if not isinstance(found, dict):
            raise SceneError(f"{path}: cannot be read as glTF: there is no JSON in it")
        return cls(found)

    def cameras(self) -> list[Placed]:
        """Return the cameras that nodes have."""
        every = self.content.get("cameras", [])
        return [
            Placed(matrix, every[node["camera"]])
            for node, matrix in self._nodes()
            if "camera" in node
        ]

    def lights(self) -> list[Placed]:
        """Return the punctual lights that nodes have."""
        every = self.content.get("extensions", {}).get(_LIGHTS, {}).get("lights", [])
        return [
            Placed(matrix, every[node["extensions"][_LIGHTS]["light"]])
            for node, matrix in self._nodes()
            if _LIGHTS in node.get("extensions", {})
        ]

    def base_color(self, name: str | None) -> list[float] | None:
        """Return the RGBA factor of a material, of which readers keep 8 bits; or None."""
        material = self._material(name)
        found = material.get("pbrMetallicRoughness", {}).get("baseColorFactor")
        return None if found is None else [float(value) for value in found]

    def emissive_strength(self, name: str | None) -> float:
        """Return by how much a material emits more than its factor says."""
        extension = self._material(name).get("extensions", {}).get(_STRENGTH, {})
        return float(extension.get("emissiveStrength", 1.0))

    def left_out(self) -> list[str]:
        """Return what the file has that no scene of ours can have, in words."""
        notes = []
        for what in ("animations", "skins"):
            if self.content.get(what):
                notes.append(f"{what}: nothing moves in a scene")
        if any(
            "targets" in primitive
            for mesh in self.content.get("meshes", [])
            for primitive in mesh.get("primitives", [])
        ):
            notes.append("morph targets: meshes keep their shape")
        for name in self.content.get("extensionsUsed", []):
            if name not in _KNOWN:
                notes.append(f"the extension {name}")
        return notes

    def _material(self, name: str | None) -> dict[str, Any]:
        found = [m for m in self.content.get("materials", []) if m.get("name") == name]
        return found[0] if name and len(found) == 1 else {}

    def _nodes(self) -> Iterator[tuple[dict[str, Any], Matrix]]:
        """Give the nodes of the file's scene, each with its matrix to the world."""
        nodes = self.content.get("nodes", [])
        scenes = self.content.get("scenes", [])
        roots: list[int] = list(range(len(nodes)))
        if scenes:
            roots = scenes[self.content.get("scene", 0)].get("nodes", [])
        waiting = [(index, np.eye(4)) for index in reversed(roots)]
        for _ in nodes:  # each is in one place, so that a circle ends too
            if not waiting:
                return
            index, parent = waiting.pop()
            node = nodes[index]
            matrix = parent @ _matrix(node)
            yield node, matrix
            waiting += [(child, matrix) for child in reversed(node.get("children", []))]


def _matrix(node: dict[str, Any]) -> Matrix:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.get("scale", (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
