"""A Mitsuba 3 scene file that grows element by element, and the files that it names."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.process.whole_file import write_whole

Node = ElementTree.Element


class SceneXml:
    """A scene and its folder of meshes and textures.

    Parameters
    ----------
    path
        Of the scene file; the folder is next to it, NAME_meshes.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.folder = path.with_name(f"{path.stem}_meshes")
        self.root = Node("scene", version="3.0.0")

    def plugin(self, parent: Node | None, tag: str, kind: str, **attributes: str) -> Node:
        """Add a plugin, such as `<bsdf type="diffuse">`; None: to the scene itself."""
        parent = self.root if parent is None else parent
        return ElementTree.SubElement(parent, tag, {"type": kind} | attributes)

    def value(self, parent: Node, tag: str, name: str, value: Any) -> None:
        """Add a property, such as `<float name="fov" value="40"/>`."""
        if isinstance(value, bool):
            text = str(value).lower()
        else:
            text = value if isinstance(value, str) else numbers(value)
        ElementTree.SubElement(parent, tag, name=name, value=text)

    def transform(self, parent: Node, matrix: NDArray[np.float64]) -> None:
        """Add a (4, 4) matrix `to_world`; nothing for the identity."""
        if not np.array_equal(matrix, np.eye(4)):
            inside = ElementTree.SubElement(parent, "transform", name="to_world")
            ElementTree.SubElement(inside, "matrix", value=numbers(matrix))

    def bitmap(
        self, parent: Node, name: str, pixels: NDArray[np.uint8], file: str, *, raw: bool
    ) -> None:
        """Add a texture, and write its PNG file."""
        from PIL import Image

        buffer = io.BytesIO()
        Image.fromarray(pixels).save(buffer, format="PNG")
        texture = self.plugin(parent, "texture", "bitmap", name=name)
        self.value(texture, "string", "filename", self.file(file, buffer.getvalue()))
        if raw:
            self.value(texture, "boolean", "raw", True)

    def mesh(
        self,
        name: str,
        vertices: ArrayLike,
        faces: ArrayLike,
        columns: dict[str, ArrayLike],
    ) -> str:
        """Write a PLY file, and return its name for the scene.

        Parameters
        ----------
        vertices
            (n, 3).
        faces
            (m, 3), numbers of vertices.
        columns
            More numbers of each vertex, (n,), such as nx or u.
        """
        points = np.asarray(vertices, np.float32)
        table = np.column_stack([points, *columns.values()]).astype("<f4")
        triangles = np.empty(len(np.asarray(faces)), [("n", "u1"), ("of", "<i4", 3)])
        triangles["n"], triangles["of"] = 3, faces
        header = [
            "ply",
            "format binary_little_endian 1.0",
            f"element vertex {len(table)}",
            *(f"property float {column}" for column in ("x", "y", "z", *columns)),
            f"element face {len(triangles)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
        return self.file(
            name, "\n".join(header).encode() + table.tobytes() + triangles.tobytes()
        )

    def file(self, name: str, content: bytes) -> str:
        """Write a file into the folder, and return its name for the scene."""
        self.folder.mkdir(exist_ok=True)
        write_whole(self.folder / name, content)
        return f"{self.folder.name}/{name}"

    def write(self) -> None:
        """Write the scene file; what it names is there already."""
        ElementTree.indent(self.root)
        write_whole(self.path, ElementTree.tostring(self.root, "utf-8") + b"\n")


def numbers(values: ArrayLike) -> str:
    """Return numbers as a scene file has them; float32 has no more digits."""
    return " ".join(f"{value:.9g}" for value in np.ravel(np.asarray(values)))
