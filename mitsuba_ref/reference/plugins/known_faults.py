"""What Mitsuba cannot do in `scalar_rgb`, or does wrong: undone on its side.

Each leaves a sentence. Without the first two there would be no picture to compare, and
without the others a picture or normals that are known to be wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.scene_file.colors.colors import OVER_WAVELENGTHS, Use, read_constant_plugin
from renderer.scene_file.description import NOWHERE, Mesh, SceneDescription
from renderer.scene_file.files import Reading
from renderer.scene_file.tree import Element

RGB_INSTEAD = "spectra that scalar_rgb cannot evaluate replaced by their colours"
PIXELS_INSTEAD = "pixels of the film in rgb"
TURNED = "normals of bump maps turned from the surface's frame into the world"
WRONG = "lights without extent divided by "
"""What a change begins with that undoes a fault; `wrong_by` makes a sentence of it."""
UNSAMPLED = "lamps of meshes found by directions that BSDFs choose, and by no others"
"""A change that leaves out light samples of meshes."""
VOLPATH = "volpath and spectral extinction in place of volpathmis: "
"""What a change begins with that renders `volpathmis` by `volpath`; the reason follows
(`volpathmis.faults_of`)."""
LAST_LOBE = "samples of the last lobe of hair in their place"
"""A change that replaces the BSDF `hair`."""
TURNED_AWAY = 1e-3
"""Distance of the unit normals of a triangle and its vertices from which on a lamp counts
as one with vertex normals. Mitsuba's density of directions to it is off by about as much,
times the tangent of the angle at which the lamp is seen."""
MESHES = ("obj", "ply", "serialized")


def give_spectra_colours(mi: Any, state: Any) -> bool:
    """Replace `regular`, `irregular` and `blackbody` where something refers to them.

    The colour is our reader's, so a comparison says nothing about it. A replaced node
    stays and is never evaluated. Returns whether a node was replaced.
    """
    found = False
    for node in state.nodes:
        emits = node.type == mi.ObjectType.Emitter
        for name, target in _references(state, node.props):
            if target.props.plugin_name() not in OVER_WAVELENGTHS:
                continue
            # of a light one colour is no emission: that of the ground below a sky
            use = Use.EMISSION if emits and name != "albedo" else Use.REFLECTANCE
            if name in ("eta", "k"):
                use = Use.REFRACTION
            if node.type != mi.ObjectType.Scene:  # there it only stands for others
                node.props[name] = mi.ScalarColor3f(*_colour(target.props, use))
                found = True
    return found


def _references(state: Any, props: Any) -> Iterator[tuple[str, Any]]:
    """Yield the name of each property that refers to a node, and the node.

    Mitsuba refuses a property that no plugin reads. So none may count as read here.
    """
    for name in list(props.keys()):
        if "Reference" not in str(props.type(name)):
            continue
        value = props[name]
        props.mark_queried(name, False)
        if type(value).__name__ == "ResolvedReference":
            yield name, state.nodes[value.index()]
        elif (index := state.id_to_index.get(value.id())) is not None:
            yield name, state.nodes[index]


def _colour(props: Any, use: Use) -> tuple[float, float, float]:
    element = Element("texture", props.plugin_name(), NOWHERE)
    for name in props.keys():
        element.add(name, props[name], NOWHERE)
    return read_constant_plugin(element, Reading([]), use)


def divide_lights_without_extent(mi: Any, scene: Any) -> str:
    """Undo that `direct` adds `emitter_samples` samples of a point light undivided.

    Returns
    -------
    What was changed, beginning with `WRONG`; empty: nothing.
    """
    match = re.search(r"emitter_samples = (\d+)", str(scene.integrator()))
    samples = int(match[1]) if match else 1
    if samples < 2:
        return ""
    lights = list(_without_extent(mi, scene))
    for emitter in lights:
        parameters = mi.traverse(emitter)
        for name in ("scale", "intensity.value", "irradiance.value"):
            if name in parameters:
                parameters[name] = parameters[name] / samples
                parameters.update()
                break
    return f"{WRONG}{samples}" if lights else ""


def _without_extent(mi: Any, scene: Any) -> Iterator[Any]:
    delta = mi.EmitterFlags.Delta
    return (e for e in scene.emitters() if mi.has_flag(e.flags(), delta))


def has_biased_lamps(description: SceneDescription) -> bool:
    """Return whether Mitsuba samples lamps whose vertex normals leave their triangles' own.

    It goes from areas to solid angles by the cosine of the interpolated normal, so that
    such lamps are too bright or too dark in `path`, `volpath` and `direct`.
    """
    integrator = description.integrator.nested or description.integrator
    sampled = {
        "path": integrator.max_depth not in (0, 1),
        "volpath": integrator.max_depth not in (0, 1),
        "direct": integrator.emitter_samples > 0,
    }
    return sampled.get(integrator.name, False) and any(
        isinstance(shape, Mesh) and shape.radiance is not None and _is_turned(shape)
        for shape in description.shapes
    )


def _is_turned(mesh: Mesh) -> bool:
    if mesh.normals is None:
        return False
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    # on whichever side: the cosine counts without its sign
    cosine = np.abs((mesh.normals[mesh.faces] * flat[:, None]).sum(axis=2))
    return bool((2.0 - 2.0 * cosine > TURNED_AWAY**2).any())


def leave_lamps_to_bsdfs(mi: Any, state: Any) -> None:
    """Undo the bias of lamps with vertex normals: sample no lamp of a mesh.

    The directions that BSDFs choose find them, with full weight since the density of a
    light that is never chosen is 0. `direct` without such directions gets one at a point.
    """
    for node in state.nodes:
        if node.props.plugin_name() == "direct" and "bsdf_samples" in node.props:
            node.props["bsdf_samples"] = max(1, node.props["bsdf_samples"])
        if node.props.plugin_name() not in MESHES:
            continue
        for _, target in _references(state, node.props):
            if target.type == mi.ObjectType.Emitter:
                target.props["sampling_weight"] = 0.0


def take_volpath(mi: Any, state: Any) -> None:
    """Undo faults of `volpathmis`: the mean of `volpath` is right in their place."""
    for node in state.nodes:
        if node.props.plugin_name() == "volpathmis":
            node.props.set_plugin_name("volpath")
            if "use_spectral_mis" in node.props:
                del node.props["use_spectral_mis"]
        if node.type == mi.ObjectType.Medium:
            node.props["has_spectral_extinction"] = True


def turn_normals_of_bump_maps(mi: Any, scene: Any, normals: NDArray[np.float32]) -> bool:
    """Undo that a `bumpmap` gives its shading normal in the frame of the surface.

    The others give theirs in the world, and so does whatever stands around a bump map.

    Parameters
    ----------
    mi, scene
        Mitsuba, and a scene of its.
    normals
        The AOV `sh_normal`, (H, W, 3), of rays through the pixels' centres; changed.

    Returns
    -------
    Whether a pixel shows such a normal.
    """
    sensor, middle = scene.sensors()[0], mi.Point2f(0.5, 0.5)
    height, width, _ = normals.shape
    found = False
    for y, x in np.ndindex(height, width):
        pixel = mi.Point2f((x + 0.5) / width, (y + 0.5) / height)
        ray, _ = sensor.sample_ray_differential(0.0, 0.5, pixel, middle)
        hit = scene.ray_intersect(ray)
        if hit.is_valid() and hit.bsdf(ray).class_name() == "BumpMap":
            normals[y, x] = hit.to_world(mi.Vector3f(normals[y, x]))
            found = True
    return found


def wrong_by(changes: tuple[str, ...]) -> str:
    """Return the sentence about the faults that were undone; empty without faults."""
    wrong = []
    factor = next((c.removeprefix(WRONG) for c in changes if c.startswith(WRONG)), "")
    if factor:
        wrong.append(
            f"by a factor of {factor}: Mitsuba adds its {factor} emitter_samples of "
            "a light without extent undivided; with such lights divided by "
            f"{factor} on its side"
        )
    if UNSAMPLED in changes:
        wrong.append(
            "in the light of lamps with vertex normals: Mitsuba samples them with "
            "the cosine of these normals instead of the triangles' own; with such lamps "
            "found by BSDF samples alone on its side"
        )
    if LAST_LOBE in changes:
        wrong.append(
            "in the last lobe of hair: Mitsuba samples it across the fibre alone; with "
            "these samples in their place on its side"
        )
    why = next((c.removeprefix(VOLPATH) for c in changes if c.startswith(VOLPATH)), "")
    if why:
        wrong.append(
            f"in the weights of its paths in media: {why}; with volpath and spectral "
            "extinction on its side"
        )
    if not wrong:
        return ""
    wrong_in = ", and ".join(wrong)
    return f"the reference is known to be wrong here, {wrong_in}, the pictures agree"
