"""Cycles as a peer: run by a Python that has `bpy`, in a process of its own.

Loads a folder of `plain_scenes` once and draws it on request. Everything that changes
the expectation is turned off: adaptive sampling, denoising, clamping, the threshold for
weak lights, and the view transform.
"""

from __future__ import annotations

import json
import math
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from mitsuba_ref.reference.json_process import Answerer, answer_requests

# Cycles XORs the seed into the hash of a pixel and selects one of few tables of samples by
# the low bits: pictures of neighbouring seeds have correlated errors, these do not.
SPREAD = 2654435761
WRAPS = {"repeat": "REPEAT", "mirror": "MIRROR", "clamp": "EXTEND"}


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Build the scene; return what renders it for each request."""
    folder = Path(job["folder"])
    given = json.loads((folder / "scene.json").read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    _set_up(scene, given, job["threads"])
    with np.load(folder / "arrays.npz") as arrays:
        images = {n: _image(n, arrays[n]) for n in arrays.files if n.startswith("texture")}
        for number, material in enumerate(given["materials"]):
            mesh = _mesh(*(arrays[f"{n}{number}"] for n in ("vertices", "faces", "uvs")))
            mesh.materials.append(_material(material, images))
            shape = bpy.data.objects.new(f"shape{number}", mesh)
            scene.collection.objects.link(shape)

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        scene.cycles.samples = wanted["spp"]
        scene.cycles.seed = (wanted["seed"] + 1) * SPREAD % 2**31
        start = time.perf_counter()
        bpy.ops.render.render()
        seconds = time.perf_counter() - start
        path = str(folder / "cycles.exr")
        bpy.data.images["Render Result"].save_render(path, scene=scene)
        image = bpy.data.images.load(path)
        pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(image.size[1], image.size[0], 4)[::-1, :, :3]
        bpy.data.images.remove(image)
        np.save(wanted["keep"], pixels)
        return {"seconds": seconds}

    return {"sampler": "sobol"}, render


def _set_up(scene: Any, given: dict[str, Any], threads: int) -> None:
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device = "CYCLES", "CPU"
    render.threads_mode, render.threads = "FIXED", threads
    render.resolution_x, render.resolution_y = given["width"], given["height"]
    render.resolution_percentage = 100
    render.use_persistent_data = True  # keeps its tree from picture to picture
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    scene.view_settings.view_transform = "Raw"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.light_sampling_threshold = 0.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type = "BOX"
    bounces = max(0, given["max_depth"] - 2)  # 0: direct light
    cycles.max_bounces = cycles.diffuse_bounces = bounces
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.angle = "HORIZONTAL", math.radians(given["fov_x"])
    lens.clip_start, lens.clip_end = 1e-3, 1e5
    camera = bpy.data.objects.new("camera", lens)
    # its camera looks along -z, +x is right
    matrix = np.array(given["to_world"]) @ np.diag([-1.0, 1.0, -1.0, 1.0])
    camera.matrix_world = matrix.T.tolist()
    scene.collection.objects.link(camera)
    scene.camera = camera
    world = scene.world = bpy.data.worlds.new("world")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (*given["sky"], 1.0)


def _image(name: str, pixels: Any) -> Any:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels[::-1]  # its first row is the lowest
    image.pixels.foreach_set(full.ravel())
    image.update()
    image.pack()
    return image


def _mesh(vertices: Any, faces: Any, uvs: Any) -> Any:
    mesh = bpy.data.meshes.new("mesh")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.astype(np.float32).ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.astype(np.int32).ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    layer = mesh.uv_layers.new(name="uv")
    layer.data.foreach_set("uv", uvs[faces.ravel()].astype(np.float32).ravel())
    mesh.update(calc_edges=True)
    mesh.shade_flat()
    return mesh


def _material(given: dict[str, Any], images: dict[str, Any]) -> Any:
    """Return a diffuse material that shines on its front; one-sided ones have no back."""
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    link = tree.links.new
    surface = tree.nodes.new("ShaderNodeBsdfDiffuse")
    if isinstance(given["colour"], dict):
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = images[given["colour"]["image"]]
        texture.extension = WRAPS[given["colour"]["wrap"]]
        nearest = given["colour"]["filter"] == "nearest"
        texture.interpolation = "Closest" if nearest else "Linear"
        link(texture.outputs["Color"], surface.inputs["Color"])
    else:
        surface.inputs["Color"].default_value = (*given["colour"], 1.0)
    closure = surface.outputs[0]
    behind = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    if given["radiance"]:
        emission = tree.nodes.new("ShaderNodeEmission")
        emission.inputs["Color"].default_value = (*given["radiance"], 1.0)
        front = tree.nodes.new("ShaderNodeMixShader")
        link(behind, front.inputs[0])
        link(emission.outputs[0], front.inputs[1])
        add = tree.nodes.new("ShaderNodeAddShader")
        link(closure, add.inputs[0])
        link(front.outputs[0], add.inputs[1])
        closure = add.outputs[0]
    if not given["two_sided"]:
        black = tree.nodes.new("ShaderNodeBsdfDiffuse")
        black.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        side = tree.nodes.new("ShaderNodeMixShader")
        link(behind, side.inputs[0])
        link(closure, side.inputs[1])
        link(black.outputs[0], side.inputs[2])
        closure = side.outputs[0]
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    link(closure, output.inputs["Surface"])
    return material


if __name__ == "__main__":
    answer_requests(load)
