"""Plugins that create triangle meshes: three file formats, and the cube."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import SceneError
from renderer.scene_file.description import Mesh
from renderer.scene_file.meshes.mesh import build_mesh, cube_mesh
from renderer.scene_file.meshes.mesh_data import MeshData, overlap
from renderer.scene_file.meshes.obj_file import read_obj
from renderer.scene_file.meshes.ply_file import read_ply
from renderer.scene_file.meshes.serialized_file import read_serialized


def read_obj_shape(properties: Any, common: dict[str, Any]) -> Mesh:
    """Read the properties of an `obj`."""
    flip = properties.boolean("flip_tex_coords", True)
    sharp = properties.boolean("face_normals", False)
    data = _file(
        properties,
        lambda path: read_obj(path, flip_tex_coords=flip, face_normals=sharp),
    )
    return _mesh(properties, common, data)


def read_ply_shape(properties: Any, common: dict[str, Any]) -> Mesh:
    """Read the properties of a `ply`."""
    flip = properties.boolean("flip_tex_coords", False)
    sharp = properties.boolean("face_normals", False)
    data = _file(
        properties,
        lambda path: read_ply(path, flip_tex_coords=flip, face_normals=sharp),
    )
    return _mesh(properties, common, data)


def read_serialized_shape(properties: Any, common: dict[str, Any]) -> Mesh:
    """Read the properties of a `serialized`."""
    index = properties.integer("shape_index", 0, at_least=0)
    sharp = properties.boolean("face_normals", False)
    data = _file(
        properties,
        lambda path: read_serialized(path, shape_index=index, face_normals=sharp),
    )
    return _mesh(properties, common, data)


def read_cube(properties: Any, common: dict[str, Any]) -> Mesh:
    """Read the properties of a `cube`."""
    return _mesh(properties, common, cube_mesh(), sharp=True)


def _mesh(
    properties: Any, common: dict[str, Any], data: MeshData, sharp: bool = False
) -> Mesh:
    """Transform a mesh; if `sharp`, keep its vertex normals and ignore face_normals."""
    face_normals = properties.boolean("face_normals", False)
    mesh, log = build_mesh(
        data,
        to_world=properties.transform("to_world"),
        face_normals=face_normals and not sharp,
        flip_normals=properties.boolean("flip_normals", False),
        **common,
    )
    for line in log:
        properties.reading.warn(properties.location, line)
    if common["radiance"] is not None and not isinstance(common["radiance"], tuple):
        _check_chart(properties, mesh)
    return mesh


def _check_chart(properties: Any, mesh: Mesh) -> None:
    """Refuse textured radiance on a mesh with missing or overlapping uv."""
    what = f"{properties.location}: {properties.element} emits a texture, "
    if mesh.uvs is None:
        raise SceneError(f"{what}but has no texture coordinates")
    if overlap(mesh.uvs[mesh.faces].astype(np.float64)):
        raise SceneError(
            f"{what}but some of its faces share a part of it, so that Mitsuba samples one "
            "of them at random; expected texture coordinates that do not overlap"
        )


def _file(properties: Any, read: Callable[[Path], MeshData]) -> MeshData:
    plugin = properties.element.plugin
    mesh: MeshData = properties.file("the mesh", f"the path of a .{plugin} file", read)
    return mesh


MESH_PLUGINS = {
    "obj": read_obj_shape,
    "ply": read_ply_shape,
    "cube": read_cube,
    "serialized": read_serialized_shape,
}
