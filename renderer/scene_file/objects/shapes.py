"""Shapes: triangle meshes from files, the cube, and the analytic ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file import transforms
from renderer.scene_file.description import (
    Bsdf,
    ConstantTexture,
    Cylinder,
    Diffuse,
    Disk,
    Mesh,
    Radiance,
    Rectangle,
    Shape,
    Sphere,
)
from renderer.scene_file.document.tree import Element
from renderer.scene_file.meshes.cube import cube_mesh
from renderer.scene_file.meshes.mesh import build_mesh
from renderer.scene_file.meshes.mesh_data import MeshData
from renderer.scene_file.meshes.obj_file import read_obj
from renderer.scene_file.meshes.ply_file import read_ply
from renderer.scene_file.meshes.surface_area import surface_area
from renderer.scene_file.meshes.uv_grid import overlap
from renderer.scene_file.objects.bsdfs import read_bsdf
from renderer.scene_file.objects.emitters import read_radiance
from renderer.scene_file.properties import Properties
from renderer.scene_file.reach import check_reach
from renderer.scene_file.reading import Reading

_STRETCH = 1e-4  # relative difference of two axes that counts as rounding


def read_shape(element: Element, reading: Reading) -> Shape:
    """Read a `<shape>`.

    Raises
    ------
    SceneError
        If it is not supported or something in it is wrong.
    """
    properties = Properties(element, reading)
    # Mitsuba's own default is black, not grey, on a shape that shines.
    nested = properties.child("bsdf")
    emitter = properties.child("emitter")
    radiance = None if emitter is None else read_radiance(element, emitter, reading)
    bsdf: Bsdf
    if nested is not None:
        bsdf = read_bsdf(nested, reading)
    elif emitter is not None:
        bsdf = Diffuse(ConstantTexture((0.0, 0.0, 0.0)))
    else:
        bsdf = Diffuse()
    properties.number("silhouette_sampling_weight", 1.0)  # for derivatives only
    match element.plugin:
        case "obj" | "ply" | "cube":
            shape = _mesh(properties, bsdf, radiance)
        case "rectangle" | "disk":
            shape = _flat(properties, bsdf, radiance)
        case "sphere":
            shape = _sphere(properties, bsdf, radiance)
        case _:
            shape = _cylinder(properties, bsdf, radiance)
    properties.finish()
    check_reach(shape, properties)
    # As float32, which is what Mitsuba and the kernels sample with.
    if radiance is not None and not np.float32(surface_area(shape)) > 0.0:
        raise SceneError(
            f"{element.location}: {element} emits light but has no area; "
            "expected an area that "
            "float32 can hold"
        )
    return shape


def _mesh(properties: Properties, bsdf: Bsdf, radiance: Radiance | None) -> Shape:
    element, reading = properties.element, properties.reading
    face_normals = properties.boolean("face_normals", False)
    if element.plugin == "cube":
        data = cube_mesh()
        face_normals = False  # the cube has none to drop; Mitsuba ignores the property too
    else:
        data = _mesh_file(properties)
    to_world = properties.transform("to_world")
    mesh, log = build_mesh(
        data,
        to_world=to_world,
        face_normals=face_normals,
        flip_normals=properties.boolean("flip_normals", False),
        bsdf=bsdf,
        radiance=radiance,
        id=element.id,
        location=element.location,
    )
    for line in log:
        reading.warn(element.location, line)
    assert isinstance(mesh, Mesh)
    if radiance is not None and not isinstance(radiance, tuple):
        _check_chart(properties, mesh)
    return mesh


def _check_chart(properties: Properties, mesh: Mesh) -> None:
    """Refuse a textured lamp whose points are not known by their (u, v)."""
    what = f"{properties.location}: {properties.element} emits a texture, "
    if mesh.uvs is None:
        raise SceneError(f"{what}but has no texture coordinates")
    if overlap(mesh.uvs[mesh.faces].astype(np.float64)):
        raise SceneError(
            f"{what}but some of its faces share a part of it, so that Mitsuba samples one "
            "of them at random; expected texture coordinates that do not overlap"
        )


def _mesh_file(properties: Properties) -> MeshData:
    plugin = properties.element.plugin
    if not properties.has("filename"):
        properties.fail("filename", "nothing", f"the path of a .{plugin} file")
    name = properties.string("filename", "")
    location = properties.element.properties["filename"].location
    path: Path = properties.reading.find_file(name, location, "the mesh")
    flip = properties.boolean("flip_tex_coords", plugin == "obj")
    try:
        if plugin == "obj":
            return read_obj(path, flip_tex_coords=flip)
        return read_ply(path, flip_tex_coords=flip)
    except SceneError as error:
        raise SceneError(f"{location}: {properties.element}: {error}") from None


def _flat(properties: Properties, bsdf: Bsdf, radiance: Radiance | None) -> Shape:
    element = properties.element
    if element.plugin == "rectangle":
        properties.boolean("face_normals", False)  # flat anyway
    kind = Rectangle if element.plugin == "rectangle" else Disk
    return kind(
        bsdf=bsdf,
        radiance=radiance,
        id=element.id,
        location=element.location,
        to_world=properties.transform("to_world"),
        flip_normals=properties.boolean("flip_normals", False),
    )


def _sphere(properties: Properties, bsdf: Bsdf, radiance: Radiance | None) -> Sphere:
    element = properties.element
    center = properties.vector("center", (0.0, 0.0, 0.0))
    radius = properties.number("radius", 1.0, above=0.0)
    to_world = properties.transform("to_world")
    lengths = transforms.column_lengths(to_world)
    if transforms.has_shear(to_world) or np.ptp(lengths) > _STRETCH * lengths.max():
        properties.fail(
            "to_world",
            "a transform that makes an ellipsoid",
            "a rotation, translation and uniform scale",
        )
    flip = properties.boolean("flip_normals", False)
    return Sphere(
        bsdf=bsdf,
        radiance=radiance,
        id=element.id,
        location=element.location,
        to_world=_placed(
            properties,
            to_world
            @ transforms.translate(*center)
            @ transforms.scale(radius, radius, radius),
        ),
        # Mitsuba turns a mirrored sphere inside out, and it alone of the analytic shapes.
        flip_normals=flip != transforms.mirrors(to_world),
    )


def _cylinder(properties: Properties, bsdf: Bsdf, radiance: Radiance | None) -> Cylinder:
    element = properties.element
    p0 = np.array(properties.vector("p0", (0.0, 0.0, 0.0)))
    p1 = np.array(properties.vector("p1", (0.0, 0.0, 1.0)))
    radius = properties.number("radius", 1.0, above=0.0)
    axis = p1 - p0
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        properties.fail("p1", "the same point as p0", "another point")
    to_world = properties.transform("to_world")
    local = transforms.translate(*p0) @ transforms.z_to(axis)
    full = _placed(properties, to_world @ local @ transforms.scale(radius, radius, length))
    lengths = transforms.column_lengths(full)
    if (
        transforms.has_shear(full)
        or abs(lengths[0] - lengths[1]) > _STRETCH * lengths[:2].max()
    ):
        properties.fail(
            "to_world",
            "a transform that makes the tube elliptic or slanted",
            "a rotation, translation and uniform scale",
        )
    if radiance is not None and not isinstance(radiance, tuple):
        raise SceneError(
            f"{element.location}: {element} emits a texture, whose points Mitsuba puts in "
            "wrong places on a cylinder; expected one colour"
        )
    if radiance is not None and transforms.mirrors(to_world):
        properties.fail(
            "to_world",
            "a mirrored cylinder that emits, whose two sides Mitsuba confuses",
            "a transform without reflection",
        )
    return Cylinder(
        bsdf=bsdf,
        radiance=radiance,
        id=element.id,
        location=element.location,
        to_world=full,
        flip_normals=properties.boolean("flip_normals", False),
    )


def _placed(properties: Properties, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of transforms, if it is still usable."""
    if (reason := transforms.why_unusable(matrix)) is not None:
        raise SceneError(
            f"{properties.location}: {properties.element} cannot be placed: {reason}"
        )
    return matrix
