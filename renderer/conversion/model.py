"""A model, such as glTF, OBJ, PLY or STL, becomes a scene with a camera and light.

Files are read by `trimesh`, which is the extra `convert`.
"""

from __future__ import annotations

import itertools
import logging
import math
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.conversion.gltf_header import GltfHeader, Placed
from renderer.conversion.model_materials import Material, Materials
from renderer.conversion.scene_xml import Node, SceneXml, numbers
from renderer.errors import SceneError

MISSING = "models are read by trimesh: pip install 'lightproof[convert]'"
SPP, HEIGHT, ASPECT = 64, 480, 4.0 / 3.0
MAX_DEPTH = 8
FOV = 35.0  # [deg] of the smaller side, of the camera that a model without one gets
MARGIN = 1.05  # times the distance at which the bounding box fits exactly
_AXES = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}
_TOWARDS = {  # from the model to that camera, of length 1
    "y": np.array([0.55, 0.4, 0.75]) / math.sqrt(1.025),
    "z": np.array([0.55, -0.75, 0.4]) / math.sqrt(1.025),
}
_SKY, _SUN = (0.6, 0.6, 0.6), (1.6, 1.6, 1.6)  # radiance, irradiance
_LEFT_OUT = re.compile("unable|fail|not loaded|unsupported|missing", re.IGNORECASE)
_Z_UP = (".stl", ".3mf")  # other formats have y upwards
# glTF's cameras look along -z and have +x to the right, Mitsuba's +z and +x to the left
_TURNED = np.diag([-1.0, 1.0, -1.0, 1.0])
Matrix = NDArray[np.float64]


def convert_model(path: Path, output: Path, up: str | None = None) -> list[str]:
    """Write a model as a scene, with its meshes and textures in a folder next to it.

    Parameters
    ----------
    path
        The model.
    output
        The scene file.
    up
        "y" or "z", for the camera of a model without one; None: what its format has.

    Returns
    -------
    What was not carried over or was added, a line each.

    Raises
    ------
    SceneError
        If `trimesh` is missing, or the model cannot be read or has no triangles.
    """
    try:
        import trimesh
    except ModuleNotFoundError as error:
        if error.name != "trimesh":
            raise
        raise SceneError(MISSING) from None
    if not path.is_file():
        raise SceneError(f"{path}: no such file")
    header = GltfHeader.of(path)
    try:
        with _said_by_trimesh() as missing:
            model = trimesh.load_scene(str(path), process=False)
    except Exception as error:  # whatever a reader of many formats raises
        said = " ".join(str(error).split())
        raise SceneError(
            f"{path}: cannot be read: {type(error).__name__}: {said}"
        ) from None
    scene, notes = SceneXml(output), [*header.left_out(), *missing]
    if not any(len(getattr(mesh, "faces", ())) for mesh in model.geometry.values()):
        raise SceneError(f"{path}: has no triangles")
    _Conversion(scene, model, header, notes).run(up or _up(path))
    scene.write()
    return notes


@contextmanager
def _said_by_trimesh() -> Iterator[list[str]]:
    """Give the lines of the log about what is left out, such as a lost texture."""
    said: list[str] = []

    class Handler(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            line = " ".join(record.getMessage().split())
            if _LEFT_OUT.search(line) and line not in said:
                said.append(line)

    log, handler = logging.getLogger("trimesh"), Handler()
    level, propagate = log.level, log.propagate
    log.addHandler(handler)
    log.setLevel(logging.DEBUG)
    log.propagate = False
    try:
        yield said
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
        log.propagate = propagate


def _up(path: Path) -> str:
    return "z" if path.suffix.lower() in _Z_UP else "y"


class _Conversion:
    """One model on its way."""

    def __init__(
        self, scene: SceneXml, model: Any, header: GltfHeader, notes: list[str]
    ) -> None:
        self._scene, self._model, self._header, self._notes = scene, model, header, notes
        self._materials = Materials(scene, header, notes)
        self._files: dict[str, str] = {}  # of geometries

    def run(self, up: str) -> None:
        """Add all that the model has."""
        placed = self._placed()
        root = self._scene.root
        integrator = self._scene.plugin(root, "integrator", "path")
        self._scene.value(integrator, "integer", "max_depth", MAX_DEPTH)
        cameras = self._header.cameras()
        if cameras:
            self._camera(cameras[0])
        else:
            self._framing_camera(np.asarray(self._model.bounds), up)
        if len(cameras) > 1:
            self._notes.append(f"{len(cameras) - 1} cameras: the first one is taken")
        uses = Counter(name for name, _ in placed)
        for name, matrix in placed:
            mesh = self._model.geometry[name]
            material, colored = self._materials.of(mesh)
            if uses[name] > 1 and not material.radiance:
                self._instance(name, mesh, material, colored, matrix)
            else:
                self._shape(root, name, mesh, material, colored, matrix)
        lights = self._header.lights()
        for light in lights:
            self._light(light)
        if not lights:
            self._daylight(up)

    def _placed(self) -> list[tuple[str, Matrix]]:
        """Return the names of meshes and where they stand; note what is no mesh."""
        found = []
        for node in self._model.graph.nodes_geometry:
            matrix, name = self._model.graph[node]
            mesh = self._model.geometry[name]
            if len(getattr(mesh, "faces", ())) == 0:
                self._notes.append(f"{name}: points or lines, which have no triangles")
            elif abs(np.linalg.det(matrix[:3, :3])) < 1e-30:
                self._notes.append(f"{node}: scaled to nothing")
            else:
                found.append((name, np.asarray(matrix, np.float64)))
        return found

    # -------------------------------------------------------------------- shapes

    def _shape(
        self,
        parent: Node,
        name: str,
        mesh: Any,
        material: Material,
        colored: bool,
        matrix: Matrix,
    ) -> None:
        shape = self._scene.plugin(parent, "shape", "ply")
        if name not in self._files:
            self._files[name] = self._write(name, mesh, colored)
        self._scene.value(shape, "string", "filename", self._files[name])
        if not _has_normals(mesh):
            self._scene.value(shape, "boolean", "face_normals", True)
        self._scene.transform(shape, matrix)
        self._ref(shape, material.id)
        if material.radiance:
            emitter = self._scene.plugin(shape, "emitter", "area")
            self._scene.value(emitter, "rgb", "radiance", material.radiance)

    def _instance(
        self, name: str, mesh: Any, material: Material, colored: bool, matrix: Matrix
    ) -> None:
        """Place a mesh that stands at several places, and is stored once."""
        known = name in self._files
        id_ = f"group_{len(self._files) if not known else list(self._files).index(name)}"
        if not known:
            group = self._scene.plugin(None, "shape", "shapegroup", id=id_)
            self._shape(group, name, mesh, material, colored, np.eye(4))
        instance = self._scene.plugin(None, "shape", "instance")
        self._ref(instance, id_)
        self._scene.transform(instance, matrix)

    def _ref(self, parent: Node, id_: str) -> None:
        parent.append(Node("ref", id=id_))

    def _write(self, name: str, mesh: Any, colored: bool) -> str:
        columns: dict[str, Any] = {}
        if _has_normals(mesh):
            columns |= dict(zip(("nx", "ny", "nz"), mesh.vertex_normals.T, strict=True))
        uv = getattr(mesh.visual, "uv", None)
        if uv is not None:
            # trimesh has v = 0 at the bottom of a picture, a `bitmap` at its top
            columns |= {"u": uv[:, 0], "v": 1.0 - uv[:, 1]}
        if colored:
            colors = np.asarray(mesh.visual.vertex_colors)[:, :3] / 255.0
            columns |= dict(zip("rgb", colors.T, strict=True))
        word = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")[:40]
        file = f"{len(self._files):03}_{word or 'mesh'}.ply"
        return self._scene.mesh(file, mesh.vertices, mesh.faces, columns)

    # ------------------------------------------------------------ cameras and lights

    def _camera(self, camera: Placed) -> None:
        kind = camera.content.get("type", "perspective")
        content = camera.content.get(kind, {})
        matrix = _without_scale(camera.to_world) @ _TURNED
        aspect = float(content.get("aspectRatio", ASPECT))
        if kind == "perspective":
            sensor = self._sensor("perspective", matrix, aspect)
            self._scene.value(sensor, "string", "fov_axis", "y")
            self._scene.value(sensor, "float", "fov", math.degrees(content["yfov"]))
        else:
            half = float(content.get("xmag", 1.0))
            aspect = half / float(content.get("ymag", half))
            matrix = matrix @ np.diag([half, half, 1.0, 1.0])
            sensor = self._sensor("orthographic", matrix, aspect)
        if content.get("znear", 0.0) > 0.0:
            self._scene.value(sensor, "float", "near_clip", content["znear"])

    def _framing_camera(self, bounds: Matrix, up: str) -> None:
        """Add a camera that sees the whole bounding box, from above on its right."""
        center, upwards, towards = bounds.mean(axis=0), _AXES[up], _TOWARDS[up]
        right = np.cross(upwards, towards) / np.linalg.norm(np.cross(upwards, towards))
        basis = np.array([right, np.cross(towards, right), towards])
        corners = np.array(list(itertools.product(*bounds.T))) - center
        x, y, z = basis @ corners.T
        slope = math.tan(math.radians(FOV / 2.0))
        distance = float(np.max(np.maximum(abs(x) / ASPECT, abs(y)) / slope + z))
        distance = max(MARGIN * distance, 1e-6)
        sensor = self._sensor("perspective", None, ASPECT)
        self._scene.value(sensor, "string", "fov_axis", "smaller")
        self._scene.value(sensor, "float", "fov", FOV)
        self._scene.value(sensor, "float", "near_clip", distance / 1000.0)
        self._scene.value(sensor, "float", "far_clip", 10.0 * distance)
        place = Node("transform", name="to_world")
        look = {"origin": center + distance * towards, "target": center, "up": upwards}
        place.append(Node("lookat", {key: numbers(value) for key, value in look.items()}))
        sensor.append(place)

    def _sensor(self, kind: str, matrix: Matrix | None, aspect: float) -> Node:
        width = max(1, round(HEIGHT * aspect))
        for name, value in (("spp", SPP), ("width", width), ("height", HEIGHT)):
            self._scene.root.insert(0, Node("default", name=name, value=str(value)))
        sensor = self._scene.plugin(None, "sensor", kind)
        if matrix is not None:
            self._scene.transform(sensor, matrix)
        sampler = self._scene.plugin(sensor, "sampler", "multijitter")
        self._scene.value(sampler, "integer", "sample_count", "$spp")
        film = self._scene.plugin(sensor, "film", "hdrfilm")
        self._scene.value(film, "integer", "width", "$width")
        self._scene.value(film, "integer", "height", "$height")
        return sensor

    def _daylight(self, up: str) -> None:
        """Add an even sky and a sun; the sky alone would show no shape of a convex body."""
        self._notes.append("no lights, so an even sky and a sun were added")
        sky = self._scene.plugin(None, "emitter", "constant")
        self._scene.value(sky, "rgb", "radiance", _SKY)
        sun = self._scene.plugin(None, "emitter", "directional")
        direction = numbers(-_TOWARDS[up] - _AXES[up] + 0.7 * np.roll(_TOWARDS[up], 1))
        sun.append(Node("vector", name="direction", value=direction))
        self._scene.value(sun, "rgb", "irradiance", _SUN)

    def _light(self, light: Placed) -> None:
        """Add a punctual light; the numbers of candela and lux are taken as they are."""
        content, kind = light.content, light.content.get("type")
        color = np.array(content.get("color", (1.0, 1.0, 1.0)), np.float64)
        color = color * float(content.get("intensity", 1.0))
        matrix = _without_scale(light.to_world)
        if "range" in content:
            self._notes.append("the range of a light: light has no end here")
        if kind == "point":
            emitter = self._scene.plugin(None, "emitter", "point")
            point = Node("point", name="position", value=numbers(matrix[:3, 3]))
            emitter.append(point)
            self._scene.value(emitter, "rgb", "intensity", color)
        elif kind == "directional":
            emitter = self._scene.plugin(None, "emitter", "directional")
            direction = Node("vector", name="direction", value=numbers(-matrix[:3, 2]))
            emitter.append(direction)
            self._scene.value(emitter, "rgb", "irradiance", color)
        elif kind == "spot":
            cone = content.get("spot", {})
            outer = float(cone.get("outerConeAngle", math.pi / 4.0))
            inner = float(cone.get("innerConeAngle", 0.0))
            emitter = self._scene.plugin(None, "emitter", "spot")
            self._scene.transform(emitter, matrix @ _TURNED)
            self._scene.value(emitter, "float", "cutoff_angle", math.degrees(outer))
            self._scene.value(emitter, "float", "beam_width", math.degrees(inner))
            self._scene.value(emitter, "rgb", "intensity", color)
        else:
            self._notes.append(f"a light of the kind {kind}")


def _without_scale(matrix: Matrix) -> Matrix:
    """Return a rotation and a translation; a camera's node may be scaled."""
    u, _, v = np.linalg.svd(matrix[:3, :3])
    found = matrix.copy()
    found[:3, :3] = u @ v
    return found


def _has_normals(mesh: Any) -> bool:
    """Tell whether the file has normals of the vertices.

    The property makes some where there are none; trimesh looks here too when it writes.
    """
    return "vertex_normals" in mesh._cache.cache
