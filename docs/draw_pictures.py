"""Draw docs/pictures by our renderer: every scene, every BSDF, the strips of the README.

`python docs/draw_pictures.py` draws all of them, and `python docs/draw_pictures.py NAME...`
some, as JPEG files of some kilobytes each. One strip needs Mitsuba.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
sys.path[:0] = map(str, (ROOT, ROOT / "docs", ROOT / "tests"))

import renderer  # noqa: E402
from mitsuba_ref.records.request import RenderRequest  # noqa: E402
from mitsuba_ref.reference.cache import read_entry  # noqa: E402
from mitsuba_ref.reference.picture_process import MitsubaWorker  # noqa: E402
from renderer.rendering.picture.image_files import encode_png  # noqa: E402

PICTURES = ROOT / "docs" / "pictures"
SCENES = ROOT / "scenes"
HEIGHT = 225  # [pixels] of a scene
BALL = 144  # [pixels] of both sides
QUALITY = 84  # of JPEG
QUALITY_OF_BALLS = 60  # all pictures together stay below 500 kB
GAP = 6  # [pixels] between the parts of a strip

Floats = NDArray[Any]

# ---------------------------------------------------------------------------- scenes

ASPECT = {  # width / height, of the scene files
    "bumps": 2.66,
    "measured-ball": 1.78,
    "rough-materials": 1.6,
    "smooth-mesh": 1.55,
}
SQUARE = ("cornell-box", "kaleidoscope", "leaves", "principled-gallery")
WIDE = (
    "analytic-shapes",
    "emitters",
    "evening-sky",
    "instances",
    "metals",
    "mist",
    "white-furnace",
)
SAMPLES = 256


def width_of(name: str) -> int:
    """Return the width of a scene's picture of the height `HEIGHT`."""
    aspect = 1.0 if name in SQUARE else 1.5 if name in WIDE else ASPECT.get(name, 4 / 3)
    return round(aspect * HEIGHT)


def scene_picture(name: str) -> Floats:
    """Return the picture of a scene of `scenes/`."""
    size = {"width": width_of(name), "height": HEIGHT}
    if name == "cropped-film":  # its window is in pixels
        size = {}
    scene = renderer.load_file(SCENES / name / "scene.xml", **size)
    return renderer.render(scene, spp=SAMPLES).pixels


# ----------------------------------------------------------------------------- BSDFs

RED = {"type": "rgb", "value": [0.7, 0.12, 0.08]}
CHECKS = {"type": "checkerboard", "to_uv": renderer.scale([16, 8, 1])}
BSDFS: dict[str, dict[str, Any]] = {
    "diffuse": {"reflectance": RED},
    "dielectric": {},
    "thindielectric": {},
    "conductor": {"material": "Au"},
    "roughdielectric": {"alpha": 0.2},
    "roughconductor": {"material": "Cu", "alpha": 0.25},
    "plastic": {"diffuse_reflectance": RED},
    "roughplastic": {"diffuse_reflectance": RED, "alpha": 0.2},
    "pplastic": {"diffuse_reflectance": RED, "alpha": 0.2},
    "principled": {"base_color": RED, "roughness": 0.4, "clearcoat": 1.0},
    "principledthin": {"base_color": RED, "roughness": 0.4, "diff_trans": 1.0},
    "merl": {"filename": str(SCENES / "measured-ball" / "measured" / "bronze.binary")},
    "measured": {"filename": str(ROOT / "tests" / "plugins" / "copper_rgb.bsdf")},
    "hair": {"eumelanin": 0.2, "pheomelanin": 0.4},
    "null": {},
    "polarizer": {},
    "circular": {"transmittance": RED},
    "retarder": {"transmittance": RED},
    "twosided": {"inside": {"type": "diffuse", "reflectance": RED}},
    "mask": {"opacity": CHECKS, "inside": {"type": "diffuse", "reflectance": RED}},
    "blendbsdf": {
        "weight": CHECKS,
        "first": {"type": "diffuse", "reflectance": RED},
        "second": {"type": "conductor", "material": "Au"},
    },
    "normalmap": {
        "normalmap": {
            "type": "bitmap",
            "filename": str(SCENES / "bumps" / "textures" / "normals.png"),
            "raw": True,
        },
        "inside": {"type": "roughconductor", "material": "Cu", "alpha": 0.25},
    },
    "bumpmap": {
        "heights": {
            "type": "bitmap",
            "filename": str(SCENES / "bumps" / "textures" / "heights.png"),
            "raw": True,
        },
        "scale": 0.3,
        "inside": {"type": "plastic", "diffuse_reflectance": RED},
    },
}


def ball(bsdf: dict[str, Any]) -> Floats:
    """Return the picture of a ball of one BSDF, on a board under a sky and a lamp."""
    floor = {
        "type": "rectangle",
        "to_world": renderer.scale([6, 6, 1]),
        "bsdf": {
            "type": "diffuse",
            "reflectance": {
                "type": "checkerboard",
                "color0": {"type": "rgb", "value": [0.7, 0.7, 0.7]},
                "color1": {"type": "rgb", "value": [0.25, 0.28, 0.33]},
                "to_uv": renderer.scale([12, 12, 1]),
            },
        },
    }
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 12},
        "sensor": {
            "type": "perspective",
            "fov": 26.0,
            "to_world": renderer.look_at([0, -5, 2.2], [0, 0, 0.95], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": BALL, "height": BALL},
        },
        "sky": {
            "type": "envmap",
            "filename": str(SCENES / "evening-sky" / "textures" / "evening.exr"),
            "to_world": renderer.rotate([0, 0, 1], 200) @ renderer.rotate([1, 0, 0], 90),
        },
        "floor": floor,
        "ball": {
            "type": "sphere",
            "to_world": renderer.translate([0, 0, 1]) @ renderer.rotate([1, 0, 0], 20),
            "bsdf": bsdf,
        },
    }
    loaded = renderer.load_dict(scene, allow_outside=ROOT)
    return renderer.render(loaded, spp=256, sampler="multijitter").pixels


# ---------------------------------------------------------------------------- strips


def strip(*parts: Floats) -> Floats:
    """Return pictures of one height side by side, NaN between them."""
    gap = np.full((parts[0].shape[0], GAP, 3), np.nan)
    between = [piece for part in parts for piece in (gap, part)][1:]
    return np.concatenate(between, axis=1)


def difference(mine: Floats, reference: Floats, full: float) -> Floats:
    """Return a map: red where `mine` is brighter, blue where it is darker, white if equal.

    Colours are full where the difference is `full` times the local brightness.
    """
    scale = reference.mean(axis=2) + 0.1 * reference.mean()
    signed = np.clip((mine - reference).mean(axis=2) / (full * scale), -1.0, 1.0)
    shades = np.stack(
        [1 + np.minimum(signed, 0), 1 - abs(signed), 1 - np.maximum(signed, 0)]
    )
    return np.moveaxis(shades, 0, 2) ** 2.2  # written as sRGB


def mitsuba_picture(scene: Path, spp: int, **parameters: int) -> Floats:
    """Return Mitsuba's picture of a scene."""
    defined = {name: str(value) for name, value in parameters.items()}
    with TemporaryDirectory() as folder, MitsubaWorker() as worker:
        entry = Path(folder) / "entry.npz"
        worker.render(RenderRequest(str(scene), defined, spp=spp, seed=9), entry)
        reference = read_entry(entry)
    assert reference is not None
    return reference.pixels


def proved() -> Floats:
    """Return the Cornell box by both renderers, and their difference."""
    scene, size = SCENES / "cornell-box" / "scene.xml", {"width": 240, "height": 240}
    ours = renderer.render(renderer.load_file(scene, **size), spp=256).pixels
    theirs = mitsuba_picture(scene, 256, **size)
    return strip(ours, theirs, difference(ours, theirs, 0.5))


def judged() -> Floats:
    """Return a picture with one bounce too few, the right one, and the difference."""
    scene, size = SCENES / "cornell-box" / "scene.xml", {"width": 240, "height": 240}
    right = renderer.load_file(scene, **size)
    wrong = renderer.simplify(right, "depth=2")
    pictures = [renderer.render(one, spp=256).pixels for one in (wrong, right)]
    return strip(*pictures, difference(*pictures, 1.0))


def worked() -> Floats:
    """Return the work of a ray in a grid, a kd-tree and a BVH, on one scale."""
    scene = renderer.load_file(SCENES / "appel-teapot" / "scene.xml", width=240, height=180)
    counts = []
    for accel in ("grid", "kd-sah", "bvh"):
        aovs = renderer.render(scene, spp=1, integrator="work", accel=accel).aovs
        counts.append(aovs["work.box_tests"] + aovs["work.primitive_tests"])
    most = max(np.percentile(count, 99.5) for count in counts)
    return strip(*(heat(count[..., 0] / most) for count in counts))


def heat(share: Floats) -> Floats:
    """Return colours from black over red and yellow to white, as linear sRGB."""
    levels = 3.0 * np.clip(share, 0.0, 1.0) ** 0.6
    return np.clip(np.stack([levels, levels - 1.0, levels - 2.0], axis=2), 0.0, 1.0) ** 2.2


def own_bsdf() -> Floats:
    """Return a ball of plain diffuse and one of dust as on the Moon."""
    import own_bsdf  # noqa: F401  # of tests: it registers `lunar`

    grey = {"type": "rgb", "value": [0.9, 0.8, 0.7]}
    paper = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.3, 0.27, 0.24]}}
    return strip(*(moon(one) for one in (paper, {"type": "lunar", "albedo": grey})))


def moon(bsdf: dict[str, Any]) -> Floats:
    """Return a ball that is lit from behind the camera, on black."""
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "perspective",
            "fov": 28.0,
            "to_world": renderer.look_at([0, -5, 0], [0, 0, 0], [0, 0, 1]),
            "film": {"type": "hdrfilm", "width": 200, "height": 200},
        },
        "sun": {"type": "directional", "direction": [0.25, 1, -0.15], "irradiance": 5.0},
        "ball": {"type": "sphere", "bsdf": bsdf},
    }
    return renderer.render(renderer.load_dict(scene), spp=64).pixels


def turned() -> Floats:
    """Return four frames of a camera that turns, each with an error of 2 %."""
    from turntable import still_life

    scenes = (still_life(90 * frame, 240, 160) for frame in range(4))
    images = (renderer.render(one, spp=16384, target_error=0.02) for one in scenes)
    return strip(*(image.pixels for image in images))


def in_two_ways(name: str, spp: int, width: int, exposure: float) -> Floats:
    """Return a large scene by paths as in the file, and as they are by default."""
    from reports.trials.architecture_scenes import architecture_scene

    path = architecture_scene(name)
    scene = renderer.load_file(path, width=width, height=width * 3 // 4)
    pictures = (renderer.render(scene, spp, integrator=name) for name in ("path", "auto"))
    return strip(*(picture.pixels * exposure for picture in pictures))


# ------------------------------------------------------------------------------ files


def everything() -> dict[str, Callable[[], Floats]]:
    """Return how each picture is drawn, by the name of its file."""
    drawn: dict[str, Callable[[], Floats]] = {
        "strip-proved": proved,
        "strip-judged": judged,
        "strip-work": worked,
        "strip-own-bsdf": own_bsdf,
        "strip-turned": turned,
        "strip-panes": partial(in_two_ways, "gallery", 256, 280, 1.0),
        "strip-windows": partial(in_two_ways, "kitchen", 64, 260, 4.0),
    }
    for path in sorted(SCENES.glob("*/scene.xml")):
        drawn[path.parent.name] = partial(scene_picture, path.parent.name)
    for name, parameters in BSDFS.items():
        drawn[f"bsdf-{name}"] = partial(ball, {"type": name, **parameters})
    return {**drawn, "isosurfaces": isosurfaces}


def isosurfaces() -> Floats:
    """Return the picture of docs/isosurfaces."""
    path = ROOT / "docs" / "isosurfaces" / "scene.xml"
    scene = renderer.load_file(path, width=360, height=165)
    return renderer.render(scene, spp=32).pixels  # some hundred times as slow as a ball


def save(name: str, pixels: Floats) -> None:
    """Write a picture; NaN, between parts of a strip, is white."""
    between = np.isnan(pixels)
    picture = encode_png(np.where(between, 1.0, pixels).astype(np.float32))
    quality = QUALITY_OF_BALLS if name.startswith("bsdf-") else QUALITY
    picture.convert("RGB").save(PICTURES / f"{name}.jpg", quality=quality, optimize=True)


if __name__ == "__main__":
    drawn = everything()
    for name in sys.argv[1:] or drawn:
        save(name, drawn[name]())
        size = (PICTURES / f"{name}.jpg").stat().st_size
        sys.stdout.write(f"{name}.jpg: {size / 1000:.1f} kB\n")
        sys.stdout.flush()
