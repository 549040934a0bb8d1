"""LuxCore as a peer: run by a Python that has `pyluxcore`, in a process of its own.

Loads a folder of `plain_scenes` once and draws it on request. It stops at the requested
number of samples or up to one per cent later. Its engine that draws tiles is exact, but
gives the same picture for every seed.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np  # before pyluxcore, whose memory allocator cannot free NumPy's memory

from mitsuba_ref.reference.json_process import Answerer, answer_requests

POLL = 0.002  # [s]
pyluxcore: Any = None  # imported by `load`, when what it prints goes to standard error


def load(job: dict[str, Any]) -> tuple[dict[str, Any], Answerer]:
    """Build the scene; return what renders it for each request."""
    global pyluxcore
    import pyluxcore

    pyluxcore.Init(lambda message: None)
    folder = Path(job["folder"])
    given = json.loads((folder / "scene.json").read_text())
    scene = pyluxcore.Scene()
    scene.Parse(_properties(_camera(given)))
    with np.load(folder / "arrays.npz") as arrays:
        for name in arrays.files:
            if name.startswith("texture"):
                pixels = np.ascontiguousarray(arrays[name][::-1], np.float32)
                height, width = pixels.shape[:2]
                scene.DefineImageMap(name, pixels.ravel(), 1.0, 3, width, height)
        for number, material in enumerate(given["materials"]):
            vertices, faces, uvs = (
                list(map(tuple, arrays[f"{name}{number}"].tolist()))
                for name in ("vertices", "faces", "uvs")
            )
            scene.DefineMesh(f"mesh{number}", vertices, faces, None, uvs, None, None)
            scene.Parse(_properties(_shape(number, material)))
    if any(given["sky"]):
        sky = {"type": "constantinfinite", "color": given["sky"]}
        scene.Parse(_properties({f"scene.lights.sky.{k}": v for k, v in sky.items()}))

    def render(wanted: dict[str, Any]) -> dict[str, Any]:
        width, height = given["width"], given["height"]
        settings = {
            "renderengine.type": "PATHCPU",
            "renderengine.seed": wanted["seed"] + 1,
            "sampler.type": "SOBOL",
            "batch.haltspp": [wanted["spp"], 0],
            "native.threads.count": job["threads"],
            "path.pathdepth.total": given["max_depth"],
            "path.pathdepth.diffuse": given["max_depth"],
            "path.clamping.variance.maxvalue": 0.0,
            "film.width": width,
            "film.height": height,
            "film.filter.type": "BOX",
            "film.filter.width": 0.5,
            "film.imagepipelines.0.0.type": "NOP",
        }
        session = pyluxcore.RenderSession(
            pyluxcore.RenderConfig(_properties(settings), scene)
        )
        session.Start()  # also builds the tree, which is not timed
        start, seconds = time.perf_counter(), 0.0
        while not session.HasDone():  # which it says up to 0.2 s late
            time.sleep(POLL)
            session.UpdateStats()
            taken = session.GetStats().Get("stats.renderengine.total.samplecount")
            if not seconds and taken.GetFloat() >= wanted["spp"] * width * height:
                seconds = time.perf_counter() - start
        seconds = seconds or time.perf_counter() - start
        pixels = np.zeros(width * height * 3, np.float32)
        kind = pyluxcore.FilmOutputType.RGB
        session.GetFilm().GetOutputFloat(kind, pixels, 0)
        session.Stop()
        np.save(wanted["keep"], pixels.reshape(height, width, 3)[::-1])
        return {"seconds": seconds}

    return {"sampler": "sobol"}, render


def _properties(values: dict[str, Any]) -> Any:
    found = pyluxcore.Properties()
    for name, value in values.items():
        found.Set(pyluxcore.Property(name, value))
    return found


def _camera(given: dict[str, Any]) -> dict[str, Any]:
    matrix = np.array(given["to_world"])
    eye, forward, up = matrix[:3, 3], matrix[:3, 2], matrix[:3, 1]
    aspect = given["height"] / given["width"]
    # LuxCore 2.11 draws all rows one pixel too low: in the Cornell box the relative MSE is
    # 9.7 without this shift and 0.012 with it, and half a pixel in x makes it worse
    low = 2.0 * aspect / given["height"]
    return {
        "scene.camera.type": "perspective",
        "scene.camera.lookat.orig": eye.tolist(),
        "scene.camera.lookat.target": (eye + forward).tolist(),
        "scene.camera.up": up.tolist(),
        "scene.camera.fieldofview": given["fov_x"],
        "scene.camera.screenwindow": [-1.0, 1.0, -aspect - low, aspect - low],
        "scene.camera.autofocus.enable": False,
    }


def _shape(number: int, given: dict[str, Any]) -> dict[str, Any]:
    """Return an object with a matte material; a one-sided one has a black back."""
    colour, found = given["colour"], {}
    if isinstance(colour, dict):
        image = f"scene.textures.image{number}"
        wraps = {"clamp": "clamp", "repeat": "repeat"}
        if colour["wrap"] not in wraps or colour["filter"] == "nearest":
            raise RuntimeError("the adapter does not translate this filter of a texture")
        found = {
            f"{image}.type": "imagemap",
            f"{image}.file": colour["image"],
            f"{image}.gamma": 1.0,
            f"{image}.wrap": wraps[colour["wrap"]],
            f"{image}.mapping.type": "uvmapping2d",
            f"{image}.mapping.uvscale": [1.0, 1.0],
        }
        colour = f"image{number}"
    name = f"scene.materials.front{number}"
    found |= {f"{name}.type": "matte", f"{name}.kd": colour}
    used = f"front{number}"
    if not given["two_sided"]:
        back, both = f"scene.materials.back{number}", f"scene.materials.both{number}"
        found |= {f"{back}.type": "matte", f"{back}.kd": [0.0, 0.0, 0.0]}
        found |= {f"{both}.type": "twosided", f"{both}.frontmaterial": used}
        found[f"{both}.backmaterial"] = f"back{number}"
        used = f"both{number}"
    if given["radiance"]:
        found[f"scene.materials.{used}.emission"] = given["radiance"]
    found[f"scene.objects.shape{number}.shape"] = f"mesh{number}"
    found[f"scene.objects.shape{number}.material"] = used
    return found


if __name__ == "__main__":
    answer_requests(load)
