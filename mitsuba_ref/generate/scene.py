"""A scene at random: valid in Mitsuba by construction, and with something to be seen."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from mitsuba_ref.generate import files, grammar, surface_grammar
from mitsuba_ref.generate.coverage import Coverage
from mitsuba_ref.generate.drawing import (
    Drawing,
    DrawnScene,
    draw_plugin,
    number_text,
    plain,
)
from mitsuba_ref.generate.textures import HEIGHTS, NORMALS, light_texture
from mitsuba_ref.generate.values import look_at

BLOCK = 200
"""Scenes after which the coverage begins anew: a scene follows from the seed and from its
number, and to draw one of them at most so many others have to be drawn."""


class Scenes:
    """The scenes of a seed, by their numbers; ascending numbers are drawn the fastest."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._next = 0  # the number of the scene that is drawn next
        self._coverage = Coverage()
        self.coverage = Coverage()  # of all that were returned

    def draw(self, number: int) -> DrawnScene:
        """Return a scene."""
        start = number - number % BLOCK
        if self._next > number or self._next < start:
            self._next = start
        for k in range(self._next, number + 1):
            if k % BLOCK == 0:
                self._coverage = Coverage()
            scene = draw_scene(f"{self._seed}/{k}", self._coverage)
            self._coverage.add(scene.root)
        self._next = number + 1
        self.coverage.add(scene.root)
        return scene


def draw_scene(name: str, coverage: Coverage) -> DrawnScene:
    """Draw one scene; it follows from its name and from the coverage before it."""
    drawing = Drawing(name, coverage)
    root = Element("scene", version="3.0.0")
    integrator, method = _integrator(drawing)
    root.append(integrator)
    root.append(_sensor(drawing))
    tree = method == "whitted"  # it follows no mirrors inside of others
    bsdfs: list[Element] = []
    if drawing.chance(0.7):
        root.append(_floor(drawing, tree))
    if drawing.chance(0.2):
        shared = _bsdf(drawing, tree)
        shared.set("id", "shared")
        bsdfs.append(shared)
        root.append(shared)
    for _ in range(drawing.rng.randint(1, 3)):
        root.append(_shape(drawing, tree, bsdfs, drawing.chance(0.2) and not tree))
    if drawing.chance(0.25):
        root.extend(_instances(drawing, tree))
    for element in _lights(drawing, tree):
        root.append(element)
    if method == "volpath":
        _add_media(drawing, root)
    _limit_depth(root)
    return DrawnScene(root, drawing.files)


def _limit_depth(root: Element) -> None:
    """Give paths a depth where the sampler does not jitter.

    Its numbers are then the same at each bounce, as 0.5 with one sample, and a path that
    roulette does not end once is never ended.
    """
    if root.find(".//sampler/boolean[@name='jitter'][@value='false']") is None:
        return
    for integrator in root.iter("integrator"):
        depth = integrator.find("integer[@name='max_depth']")
        if integrator.get("type") not in ("path", "volpath"):
            continue
        if depth is None:
            depth = plain("integer", "max_depth", "-1")
            integrator.append(depth)
        if depth.get("value") == "-1":
            depth.set("value", "8")


# --------------------------------------------------------------- integrator and sensor


def _integrator(drawing: Drawing) -> tuple[Element, str]:
    """Return an integrator, and the method that colours are computed with."""
    # two of three scenes are of paths: the others show less
    paths, others = ("path", "path", "volpath"), tuple(grammar.INTEGRATORS)
    if drawing.chance(0.6):
        name = drawing.rng.choice(paths)
    else:
        name = drawing.pick("integrator", others)
    element = draw_plugin(drawing, "integrator", name, grammar.INTEGRATORS[name])
    if name == "moment" or (name == "aov" and drawing.chance(0.5)):
        inside = drawing.pick("integrator", ("path", "direct"))
        properties = grammar.INTEGRATORS[inside]
        element.append(draw_plugin(drawing, "integrator", inside, properties, "inside"))
        name = inside
    return element, name


def _sensor(drawing: Drawing) -> Element:
    name = drawing.pick("sensor", tuple(grammar.SENSORS))
    sensor = draw_plugin(drawing, "sensor", name, grammar.SENSORS[name])
    scale = 2.0 if name == "orthographic" else 0.0
    sensor.append(look_at(drawing, "to_world", (3.5, 5.5), scale))
    film = draw_plugin(drawing, "film", "hdrfilm", grammar.FILM)
    name = drawing.pick("rfilter", tuple(grammar.FILTERS))
    film.append(draw_plugin(drawing, "rfilter", name, grammar.FILTERS[name]))
    sensor.append(film)
    name = drawing.pick("sampler", tuple(grammar.SAMPLERS))
    sensor.append(draw_plugin(drawing, "sampler", name, grammar.SAMPLERS[name]))
    return sensor


# -------------------------------------------------------------------------------- BSDFs


def _bsdf(drawing: Drawing, tree: bool = False) -> Element:
    """Draw a BSDF by itself, on both sides, or of the pool of structures."""
    rest = drawing.rng.random()
    if rest < 0.25 and not tree:
        return _nested(drawing, drawing.rng.choice(surface_grammar.STRUCTURES))
    if rest < 0.45:
        drawing.opaque = True
        element = Element("bsdf", type="twosided")
        for _ in range(drawing.rng.randint(1, 2)):
            possible = [
                n for n in surface_grammar.BSDFS if n not in surface_grammar.TRANSPARENT
            ]
            element.append(_nested(drawing, drawing.pick("bsdf", possible)))
        drawing.opaque = False
        return element
    return _nested(drawing, drawing.pick("bsdf", tuple(surface_grammar.BSDFS)))


def _nested(drawing: Drawing, structure: surface_grammar.Structure) -> Element:
    """Draw a BSDF with this name, or a wrapper with what is inside of it."""
    if isinstance(structure, str):
        return draw_plugin(drawing, "bsdf", structure, surface_grammar.BSDFS[structure])
    name, *inside = structure
    assert isinstance(name, str)
    element = draw_plugin(drawing, "bsdf", name, surface_grammar.WRAPPERS[name])
    if name == "normalmap":
        element.append(draw_plugin(drawing, "texture", "bitmap", NORMALS, "normalmap"))
    if name == "bumpmap":
        element.append(draw_plugin(drawing, "texture", "bitmap", HEIGHTS, "heights"))
    outside, drawing.opaque = drawing.opaque, drawing.opaque or name == "twosided"
    for part in inside:
        assert isinstance(part, str | tuple)
        element.append(_nested(drawing, part))
    drawing.opaque = outside
    return element


# ------------------------------------------------------------------------------- shapes


def _floor(drawing: Drawing, tree: bool) -> Element:
    shape = Element("shape", type="rectangle")
    transform = SubElement(shape, "transform", name="to_world")
    SubElement(transform, "rotate", x="1", angle="-90")
    SubElement(transform, "scale", value=number_text(4.0 * drawing.unit))
    SubElement(transform, "translate", y=number_text(-drawing.unit))
    if drawing.chance(0.7):
        shape.append(_bsdf(drawing, tree))
    return shape


def _shape(
    drawing: Drawing,
    tree: bool,
    shared: list[Element],
    emits: bool,
    plugin: str = "",
    grouped: bool = False,
) -> Element:
    """Draw a shape with its BSDF, as a lamp at times."""
    possible = [
        n for n in surface_grammar.SHAPES if not (emits and n in surface_grammar.DARK)
    ]
    plugin = plugin or drawing.pick("shape", possible)
    properties = surface_grammar.SHAPES[plugin]
    if plugin in surface_grammar.UNPLACED and drawing.chance(0.4):
        properties = surface_grammar.UNPLACED[plugin]
    shape = draw_plugin(drawing, "shape", plugin, properties)
    uvs = (
        _add_mesh(drawing, shape, plugin, grouped)
        if plugin in surface_grammar.MESHES
        else True
    )
    if shared and drawing.chance(0.5):
        SubElement(shape, "ref", id="shared")
    elif drawing.chance(0.9):
        shape.append(_bsdf(drawing, tree))
    drawing.attributes = False
    if emits:
        drawing.present.append("emitter area")
        even = plugin in surface_grammar.EVEN or not uvs
        radiance = light_texture(8.0, plain_share=1.0 if even else 0.6)
        light = draw_plugin(drawing, "emitter", "area", {"radiance!": radiance})
        shape.append(light)
    return shape


def _add_mesh(drawing: Drawing, shape: Element, plugin: str, grouped: bool) -> bool:
    """Add a file; tell whether each of its points is known by its (u, v).

    A mesh may have attributes, which textures can show where it is in no group.
    """
    rng = drawing.rng
    kind = rng.choice(
        (files.draw_patch, files.draw_patch, files.draw_ball, files.draw_soup)
    )
    mesh = kind(rng)
    if plugin == "ply":
        drawing.attributes = not grouped and drawing.chance(0.6)
        content = files.ply_bytes(rng, mesh, drawing.attributes)
    elif plugin == "obj":
        content = files.obj_bytes(mesh)
    else:
        content = files.serialized_bytes(mesh, rng.choice((3, 4)))
    shape.insert(0, plain("string", "filename", drawing.keep_file(plugin, content)))
    return kind is files.draw_patch


def _instances(drawing: Drawing, tree: bool) -> list[Element]:
    group = Element("shape", type="shapegroup", id="group")
    for plugin in drawing.rng.choice(surface_grammar.GROUPS):
        group.append(_shape(drawing, tree, [], False, plugin, grouped=True))
    placed = []
    for _ in range(drawing.rng.randint(1, 2)):
        instance = draw_plugin(drawing, "shape", "instance", surface_grammar.INSTANCE)
        SubElement(instance, "ref", id="group")
        placed.append(instance)
    return [group, *placed]


# ------------------------------------------------------------------------------- lights


def _lights(drawing: Drawing, tree: bool) -> list[Element]:
    """Draw one to three lights, at most one of them an environment."""
    lights = []
    possible = list(grammar.WITHOUT_EXTENT if tree else grammar.LIGHTS)
    for _ in range(drawing.rng.choice((1, 1, 2, 3))):
        name = drawing.pick("emitter", possible)
        lights.append(draw_plugin(drawing, "emitter", name, grammar.LIGHTS[name]))
        if name in grammar.ENVIRONMENTS:
            possible = [other for other in possible if other not in grammar.ENVIRONMENTS]
    return lights


# -------------------------------------------------------------------------------- media


def _add_media(drawing: Drawing, root: Element) -> None:
    """Fill closed shapes with media; most of them let light in."""
    for shape in root.findall("shape"):
        if shape.get("type") in ("sphere", "cube") and drawing.chance(0.8):
            if drawing.chance(0.7):
                for bsdf in [*shape.findall("bsdf"), *shape.findall("ref")]:
                    shape.remove(bsdf)
                shape.append(Element("bsdf", type="null"))
            shape.append(_medium(drawing))


def _medium(drawing: Drawing) -> Element:
    name = drawing.pick("medium", tuple(grammar.MEDIUM))
    medium = draw_plugin(drawing, "medium", name, grammar.MEDIUM[name], "interior")
    medium.append(_phase(drawing, tuple(grammar.PHASES)))
    return medium


def _phase(drawing: Drawing, possible: tuple[str, ...]) -> Element:
    name = drawing.pick("phase", possible)
    phase = draw_plugin(drawing, "phase", name, grammar.PHASES[name])
    if name == "blendphase":
        simple = tuple(other for other in possible if other != "blendphase")
        phase.extend([_phase(drawing, simple), _phase(drawing, simple)])
    return phase
