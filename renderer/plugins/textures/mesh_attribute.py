"""Mesh attributes as textures: scalars or colours per vertex or per face."""

from __future__ import annotations

from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.kernels.jit import kernel, table_columns
from renderer.kernels.lanes.memory import gather_row
from renderer.kernels.lanes.vectors import dot, gather_rows3
from renderer.plugins.shapes.surface import gather_flat
from renderer.plugins.textures.kind import TextureKind
from renderer.scene_file.colors.colors import Use
from renderer.scene_file.description import Mesh, MeshAttributeTexture, Shape
from renderer.scene_file.numbers import quoted


@table_columns("places")
class MeshAttributes(NamedTuple):
    """Attributes of all triangles whose mesh has an attribute of these textures."""

    first: int  # primitive id of the first triangle
    places: NDArray[np.float32]  # (12, triangles) as in `TriangleSurfaces`
    shape: NDArray[np.int32]  # (primitives,) shape id
    # (shapes, textures): primitive id plus this is the column of `values`
    offset: NDArray[np.int32]
    values: NDArray[np.float32]  # (9, n) three values of each vertex
    scale: NDArray[np.float32]  # (textures,)


def read(properties: Any, use: Use) -> MeshAttributeTexture:
    """Read the properties of a file; the attributes of meshes are checked later."""
    if not properties.has("name"):
        properties.fail(
            "name", "nothing", "the name of an attribute: vertex_... or face_..."
        )
    name = properties.string("name", "")
    if not name.startswith(("vertex_", "face_")):
        properties.fail("name", quoted(name), "a name that begins with vertex_ or face_")
    scale = properties.number("scale", 1.0)
    return MeshAttributeTexture(name, scale, properties.location)


def mean(texture: MeshAttributeTexture, mean_of: Any = None) -> NoReturn:
    """Raise an error: the mean depends on the mesh, and Mitsuba does not have it either.

    Raises
    ------
    SceneError
        Always.
    """
    raise SceneError(
        f'{texture.location}: texture "mesh_attribute" cannot give this parameter: how '
        "often its lobe is sampled depends on the mean, which an attribute has not"
    )


def check_attribute(
    texture: MeshAttributeTexture, shape: Shape, in_group: bool, as_number: bool
) -> None:
    """Refuse an attribute that is missing, has another size, or is not finite.

    Raises
    ------
    SceneError
        Names the attributes of the shape. Instances are refused too: Mitsuba searches the
        world space point among the vertices of the group.
    """
    where = f'{texture.location}: texture "mesh_attribute"'
    if in_group:
        raise SceneError(
            f"{where} on the shape at {shape.location}, which is inside of a shapegroup; "
            "expected a mesh that is in the scene itself"
        )
    attributes = shape.attributes if isinstance(shape, Mesh) else {}
    if texture.name not in attributes:
        has = ", ".join(attributes) or "none"
        raise SceneError(
            f'{where}, property "name": the shape at {shape.location} has no attribute '
            f"{quoted(texture.name)}; it has: {has}"
        )
    size, possible = attributes[texture.name].shape[1], (1,) if as_number else (1, 3)
    if size not in possible:
        needed = "a number" if as_number else "a number or a colour"
        raise SceneError(
            f'{where}, property "name": {quoted(texture.name)} of the shape at '
            f"{shape.location} has {size} components; expected {needed}"
        )
    values = attributes[texture.name]
    if texture.name.startswith("vertex_"):
        values = values[shape.faces].reshape(-1, size)  # only those that faces use
    if bad := np.count_nonzero(~np.isfinite(values).all(axis=1)):
        of = "vertices of faces" if texture.name.startswith("vertex_") else "faces"
        raise SceneError(
            f'{where}, property "name": {quoted(texture.name)} of the shape at '
            f"{shape.location} is not finite at {bad} of {len(values)} {of}"
        )


def attribute_table(
    textures: list[MeshAttributeTexture | None], scene: Any
) -> MeshAttributes:
    """Collect the attributes of all meshes that have them."""
    triangles, shapes = scene.surfaces["triangles"], scene.description.every_shape
    offset = np.zeros((len(shapes), len(textures)), np.int32)
    values, total = [np.zeros((9, 0), np.float32)], 0
    for s, shape in enumerate(shapes):
        for t, texture in enumerate(textures):
            attributes = shape.attributes if isinstance(shape, Mesh) else {}
            if texture is None or texture.name not in attributes:
                continue
            of = attributes[texture.name]
            if of.shape[1] not in (1, 3):
                continue
            colors = np.broadcast_to(of, (len(of), 3)) if of.shape[1] == 1 else of
            faces = shape.faces
            if texture.name.startswith("face_"):
                faces = np.repeat(np.arange(len(faces))[:, None], 3, axis=1)
            offset[s, t] = total - int(np.argmax(scene.shape == s))
            values.append(colors[faces].reshape(len(faces), 9).T)
            total += len(faces)
    return MeshAttributes(
        triangles.first,
        triangles.places,
        scene.shape,
        offset,
        np.ascontiguousarray(np.concatenate(values, axis=1), np.float32),
        np.array([t.scale if t else 0.0 for t in textures], np.float32),
    )


@kernel
def attribute_color(attributes, texture, point, mask):
    """Return the attribute, interpolated by the barycentric coordinates of the point."""
    index = point.prim - attributes.first
    triangle = gather_flat(attributes, index, mask)
    edge1, edge2 = triangle.edge1, triangle.edge2
    to_point = point.position - triangle.corner
    # least squares: the point is in the plane within rounding
    a11, a12, a22 = dot(edge1, edge1), dot(edge1, edge2), dot(edge2, edge2)
    b1, b2 = dot(edge1, to_point), dot(edge2, to_point)
    inverse = 1.0 / (a11 * a22 - a12 * a12)
    u = (a22 * b1 - a12 * b2) * inverse
    v = (a11 * b2 - a12 * b1) * inverse

    shape = gather_row(attributes.shape, 0, point.prim, mask)
    place = shape * attributes.offset.shape[1] + texture
    column = point.prim + gather_row(attributes.offset, 0, place, mask)
    color = (
        gather_rows3(attributes.values, 0, column, mask) * (1.0 - u - v)
        + gather_rows3(attributes.values, 3, column, mask) * u
        + gather_rows3(attributes.values, 6, column, mask) * v
    )
    return color * gather_row(attributes.scale, 0, texture, mask)


@kernel
def attribute_scalar(attributes, texture, point, mask):
    """Return the scalar attribute; colours are refused before rendering, as in Mitsuba."""
    return attribute_color(attributes, texture, point, mask).x


MESH_ATTRIBUTE = TextureKind(
    "mesh_attribute",
    MeshAttributeTexture,
    read,
    attribute_table,
    MeshAttributes,
    attribute_color,
    attribute_scalar,
    mean,
)
