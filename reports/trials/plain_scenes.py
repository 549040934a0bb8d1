"""Scenes in the plain terms that other programs share, for adapters that draw them.

Triangles in world space with texture coordinates, diffuse materials on one or both sides,
lamps with a radiance, a constant sky, a pinhole camera and the box filter. Any other scene
is refused with a sentence.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import SceneError
from renderer.scene_file.description import (
    BitmapTexture,
    ConstantLight,
    ConstantTexture,
    Diffuse,
    Mesh,
    PerspectiveCamera,
    Rectangle,
    SceneDescription,
    Shape,
    Texture,
    TwoSided,
)

UNLIMITED = 1024  # path segments, where the scene has no limit


def write_plain_scene(description: SceneDescription, folder: Path) -> None:
    """Write scene.json and arrays.npz; shapes of one material are one mesh.

    Raises
    ------
    SceneError
        If the scene has something else than this module's first paragraph names.
    """
    camera, film = description.camera, description.camera.film
    if type(camera) is not PerspectiveCamera or camera.principal_point_offset_x:
        raise _refusal("a sensor other than a centred `perspective`")
    if film.rfilter.name != "box" or film.crop_width != film.width:
        raise _refusal(f"the film filter {film.rfilter.name!r} or a crop window")
    if description.integrator.name != "path" or description.integrator.hide_emitters:
        raise _refusal(f"the integrator {description.integrator.name!r}")
    if description.instances:
        raise _refusal("instances")
    sky = [0.0, 0.0, 0.0]
    for emitter in description.emitters:
        if not isinstance(emitter, ConstantLight):
            raise _refusal(f"a light of type {type(emitter).__name__}")
        sky = list(emitter.radiance)
    arrays: dict[str, NDArray[Any]] = {}
    groups: dict[str, list[tuple[NDArray[Any], ...]]] = {}
    materials: dict[str, dict[str, Any]] = {}
    textures: dict[int, str] = {}
    for shape in description.shapes:
        bsdf, two_sided = shape.bsdf, isinstance(shape.bsdf, TwoSided)
        if isinstance(bsdf, TwoSided) and bsdf.front is bsdf.back:
            bsdf = bsdf.front
        if not isinstance(bsdf, Diffuse):
            raise _refusal(f"the BSDF {bsdf.plugin!r}")
        if shape.radiance is not None and not isinstance(shape.radiance, tuple):
            raise _refusal("a textured lamp")
        material = {
            "colour": _colour(bsdf.reflectance, textures, arrays),
            "two_sided": two_sided,
            "radiance": shape.radiance,
        }
        key = json.dumps(material)
        materials[key] = material
        groups.setdefault(key, []).append(_triangles(shape, bsdf.reflectance))
    for number, parts in enumerate(groups.values()):
        sizes = np.cumsum([0, *(len(part[0]) for part in parts)])
        arrays[f"vertices{number}"] = np.concatenate([part[0] for part in parts])
        arrays[f"uvs{number}"] = np.concatenate([part[2] for part in parts])
        arrays[f"faces{number}"] = np.concatenate(
            [part[1] + start for part, start in zip(parts, sizes, strict=False)]
        )
    depth = description.integrator.max_depth
    content = {
        "width": film.width,
        "height": film.height,
        "fov_x": camera.fov_x,
        "to_world": camera.to_world.tolist(),
        "max_depth": UNLIMITED if depth < 0 else depth,
        "sky": sky,
        "materials": list(materials.values()),
    }
    np.savez(folder / "arrays.npz", **arrays)  # type: ignore[arg-type]
    (folder / "scene.json").write_text(json.dumps(content))


def _colour(
    texture: Texture, textures: dict[int, str], arrays: dict[str, NDArray[Any]]
) -> Any:
    """Return linear RGB, or the name of an array and how it is continued."""
    if isinstance(texture, ConstantTexture):
        return list(texture.rgb)
    if not isinstance(texture, BitmapTexture):
        raise _refusal(f"a texture of type {type(texture).__name__}")
    name = textures.setdefault(id(texture), f"texture{len(textures)}")
    arrays[name] = texture.pixels
    return {"image": name, "filter": texture.filter_type, "wrap": texture.wrap_mode}


def _triangles(shape: Shape, texture: Texture) -> tuple[NDArray[Any], ...]:
    """Return vertices (V, 3), faces (F, 3) around their normals, uv (V, 2)."""
    if isinstance(shape, Mesh) and _flat(shape):
        vertices: NDArray[Any] = shape.vertices
        faces = shape.faces[:, ::-1] if shape.flip_normals else shape.faces
        uvs = np.zeros((len(vertices), 2)) if shape.uvs is None else shape.uvs
    elif isinstance(shape, Rectangle):
        square = np.array([[-1, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1.0]])
        vertices = (square @ shape.to_world.T)[:, :3]
        faces, uvs = np.array([[0, 1, 2], [0, 2, 3]]), (square[:, :2] + 1.0) / 2.0
        if (np.linalg.det(shape.to_world[:3, :3]) < 0.0) != shape.flip_normals:
            faces = faces[:, ::-1]
    else:
        smooth = " with vertex normals" if isinstance(shape, Mesh) else ""
        raise _refusal(f"a shape of type {type(shape).__name__}{smooth}")
    if isinstance(texture, BitmapTexture):
        uvs = (np.c_[uvs, np.ones(len(uvs))] @ texture.to_uv.T)[:, :2]
    return vertices, faces, uvs


def _flat(mesh: Mesh) -> bool:
    """Return whether all vertex normals are those of their faces, as of a cube."""
    if mesh.normals is None:
        return True
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    turned = np.einsum("fkx,fx->fk", mesh.normals[mesh.faces], normals)
    return bool((np.abs(turned) > 0.99999).all())


def _refusal(what: str) -> SceneError:
    return SceneError(f"the adapter does not translate {what}")
