"""Materials of models, which `trimesh` has read, as BSDFs: mostly `principled`.

The metallic-roughness material of glTF 2.0 and `principled` are both after [Burley2012]:
base colour, metallic and roughness have the same meaning. Of OBJ materials the diffuse
colour counts, and the exponent of the highlight gives the roughness.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.conversion.gltf_header import GltfHeader
from renderer.conversion.scene_xml import Node, SceneXml
from renderer.rendering.picture.picture import srgb_from_linear

Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Material:
    """A BSDF of the scene, and the light that its surfaces emit."""

    id: str
    radiance: tuple[float, ...] = ()  # empty: none


class Materials:
    """The BSDFs of one scene, each written when it is first used."""

    def __init__(self, scene: SceneXml, header: GltfHeader, notes: list[str]) -> None:
        self._scene, self._header, self._notes = scene, header, notes
        self._made: dict[tuple[int, str], Material] = {}
        self._keep_alive: list[Any] = []  # of which `id` is a key

    def of(self, mesh: Any) -> tuple[Material, bool]:
        """Return the material of a mesh, and whether it has colours of its vertices."""
        visual = mesh.visual
        material = getattr(visual, "material", None)
        colored = material is None and visual.kind in ("vertex", "face")
        flat = material is None or getattr(visual, "uv", None) is None
        kind = "vertex colours" if colored else "no uv" if flat else "uv"
        key = id(material), kind
        if key not in self._made:
            self._keep_alive.append(material)
            number = len(self._made)
            if material is None:
                self._made[key] = self._plain(f"material_{number}", colored)
            else:
                self._made[key] = self._write(f"material_{number}", material, flat)
        if visual.kind == "face":
            self._note("colours of faces: each vertex has the mean of its faces")
        return self._made[key], colored

    def _plain(self, name: str, colored: bool) -> Material:
        bsdf = self._two_sides(None, name)
        inner = self._scene.plugin(bsdf, "bsdf", "diffuse")
        if colored:
            texture = self._scene.plugin(
                inner, "texture", "mesh_attribute", name="reflectance"
            )
            self._scene.value(texture, "string", "name", "vertex_color")
        return Material(name)

    def _two_sides(self, parent: Node | None, name: str) -> Node:
        """Add what shows a material from behind too, as other programs do."""
        attributes = {} if parent is not None else {"id": name}
        return self._scene.plugin(parent, "bsdf", "twosided", **attributes)

    def _write(self, name: str, found: Any, flat: bool) -> Material:
        label = f"material {getattr(found, 'name', None) or name}"
        metallic_default = 1.0
        if not hasattr(found, "metallicFactor"):  # of an OBJ file, and several in one mesh
            if hasattr(found, "materials"):
                self._note(f"{label}: the first of several in one mesh counts")
            emitted = getattr(found, "kwargs", {}).get("ke")
            found, metallic_default = found.to_pbr(), 0.0
            found.emissiveFactor = emitted
        texture = None if flat else found.baseColorTexture
        if flat and found.baseColorTexture is not None:
            self._note(f"{label}: textures, as the mesh has no uv")
        factor = self._header.base_color(found.name)
        if factor is None:
            color = found.baseColorFactor
            factor = [1.0] * 4 if color is None else (np.asarray(color) / 255.0).tolist()
        rgba = None if texture is None else np.asarray(texture.convert("RGBA"))

        around = self._masked(name, found, factor, rgba)
        inside = self._two_sides(around, name)
        if not flat and found.normalTexture is not None:
            inside = self._scene.plugin(inside, "bsdf", "normalmap")
            normals = np.asarray(found.normalTexture.convert("RGB"))
            self._scene.bitmap(
                inside, "normalmap", normals, f"{name}_normals.png", raw=True
            )
        bsdf = self._scene.plugin(inside, "bsdf", "principled")
        if rgba is None:
            self._scene.value(bsdf, "rgb", "base_color", factor[:3])
        else:
            pixels = _times(rgba[:, :, :3], factor[:3])
            self._scene.bitmap(bsdf, "base_color", pixels, f"{name}_base.png", raw=False)
        of_both = None if flat else found.metallicRoughnessTexture
        for channel, key, default in (
            (2, "metallic", metallic_default),
            (1, "roughness", 1.0),
        ):
            number = getattr(found, f"{key}Factor")
            number = default if number is None else number
            if of_both is None:
                self._scene.value(bsdf, "float", key, number)
            else:
                plane = np.asarray(of_both.convert("RGB"))[:, :, channel]
                levels = np.rint(plane * min(number, 1.0)).astype(np.uint8)
                self._scene.bitmap(bsdf, key, levels, f"{name}_{key}.png", raw=True)
        if found.occlusionTexture is not None:
            self._note(f"{label}: the occlusion texture, as light is traced")
        return Material(name, self._radiance(label, found))

    def _masked(
        self, name: str, found: Any, factor: list[float], rgba: Pixels | None
    ) -> Node | None:
        """Add what lets light through where alpha says so; None where nothing does."""
        mode = found.alphaMode
        if mode not in ("MASK", "BLEND"):
            return None
        cutoff = 0.5 if found.alphaCutoff is None else found.alphaCutoff
        if rgba is None:
            alpha = float(factor[3]) if mode == "BLEND" else float(factor[3] >= cutoff)
            if alpha >= 1.0:
                return None
            mask = self._scene.plugin(None, "bsdf", "mask", id=name)
            self._scene.value(mask, "float", "opacity", alpha)
            return mask
        plane = rgba[:, :, 3] / 255.0 * factor[3]
        if mode == "MASK":
            plane = (plane >= cutoff).astype(np.float64)
        mask = self._scene.plugin(None, "bsdf", "mask", id=name)
        levels = np.rint(255.0 * plane).astype(np.uint8)
        self._scene.bitmap(mask, "opacity", levels, f"{name}_opacity.png", raw=True)
        return mask

    def _radiance(self, label: str, found: Any) -> tuple[float, ...]:
        factor = found.emissiveFactor
        if factor is None or not np.any(factor):
            return ()
        radiance = np.asarray(factor) * self._header.emissive_strength(found.name)
        if found.emissiveTexture is not None:
            texels = np.asarray(found.emissiveTexture.convert("RGB"))
            radiance = radiance * _linear(texels).mean(axis=(0, 1))
            self._note(f"{label}: the emissive texture; its mean is emitted")
        return tuple(radiance.tolist()) if radiance.any() else ()

    def _note(self, text: str) -> None:
        if text not in self._notes:
            self._notes.append(text)


def _linear(encoded: Pixels) -> NDArray[np.float64]:
    """Decode bytes of sRGB."""
    values = encoded / 255.0
    curve = ((values + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, values / 12.92, curve)


def _times(encoded: Pixels, factor: list[float]) -> Pixels:
    """Return a picture in sRGB whose linear values are multiplied by a factor."""
    if all(value == 1.0 for value in factor):
        return encoded
    return np.rint(255.0 * srgb_from_linear(_linear(encoded) * factor)).astype(np.uint8)
