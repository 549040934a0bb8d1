"""Integrators: direct, whitted, path, depth, and aov and moment around another one.

One that is not supported is no error yet: its scene can be rendered by another one.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

from renderer.errors import SceneError
from renderer.names import INTEGRATORS
from renderer.scene_file.description import AOV_KINDS, Integrator, Moments
from renderer.scene_file.document.tree import UNNAMED, Element
from renderer.scene_file.numbers import quoted, split_list
from renderer.scene_file.plugins import supported_plugins
from renderer.scene_file.properties import Properties
from renderer.scene_file.reading import Reading

_MOST = 2**31 - 1


# For these the file's volpath and path have the same expected picture only if shadow rays
# pass nothing: volpath's see through these BSDFs, path's do not.
_SEEN_THROUGH = ("null", "mask", "thindielectric")


def read_integrator(
    element: Element | None, reading: Reading, scene: Element | None = None
) -> Integrator:
    """Read an `<integrator>`; None is Mitsuba's default, `path` without a depth limit.

    Of one that is not supported nothing is read but its name, and `refusal` says why.

    Parameters
    ----------
    element, reading
        What is read.
    scene
        The scene around it, with references resolved: it decides whether `path` can stand
        for an integrator of volumes. None: it cannot.

    Raises
    ------
    SceneError
        If something in it is wrong.
    """
    if element is None:
        return Integrator()
    if element.plugin in ("volpath", "volpathmis"):
        return _volume_path(element, reading, scene)
    if element.plugin not in supported_plugins("integrator"):
        possible = ", ".join(supported_plugins("integrator"))
        return _refused(
            element, f"is not supported; supported integrator plugins: {possible}"
        )
    properties = Properties(element, reading)
    if element.plugin == "moment":
        return _moment(properties, scene)
    match element.plugin:
        case "path":
            integrator = _path(properties)
        case "whitted":
            integrator = Integrator(
                "whitted",
                max_depth=properties.integer("max_depth", 8, at_least=-1, at_most=_MOST),
                hide_emitters=properties.boolean("hide_emitters", False),
                cutoff=properties.number("cutoff", 1.0 / 1024.0, above=0.0, at_most=1.0),
            )
        case "direct":
            integrator = _direct(properties)
        case "depth":
            properties.boolean("hide_emitters", False)  # distances have no emitters
            integrator = Integrator("depth")
        case _:
            integrator = _aov(properties, scene)
    integrator = _with_work(integrator, properties)
    properties.finish()
    return integrator


def _with_work(integrator: Integrator, properties: Properties) -> Integrator:
    """Read how Mitsuba divides its work: of interest for a replay of its numbers alone."""
    block_size = properties.integer("block_size", 0, at_least=0)
    one_pass = not properties.has("samples_per_pass")
    properties.integer("samples_per_pass", 1, at_least=1)
    timeout = properties.number("timeout", -1.0)
    if timeout > 0.0:
        properties.fail(
            "timeout", f"{timeout:g} s", "none: pictures are always finished here"
        )
    return dataclasses.replace(integrator, block_size=block_size, one_pass=one_pass)


def _refused(element: Element, why: str) -> Integrator:
    others = ", ".join(INTEGRATORS[1:])
    return Integrator(
        element.plugin,
        refusal=f"{element.location}: {element} {why}; --integrator path, or in Python "
        f'render(scene, integrator="path"), renders the scene with path ({others} are '
        "possible too)",
    )


def _path(properties: Properties) -> Integrator:
    return Integrator(
        "path",
        max_depth=properties.integer("max_depth", -1, at_least=-1, at_most=_MOST),
        rr_depth=properties.integer("rr_depth", 5, at_least=1, at_most=_MOST),
        hide_emitters=properties.boolean("hide_emitters", False),
    )


def _volume_path(element: Element, reading: Reading, scene: Element | None) -> Integrator:
    """Read volpath or volpathmis as path, where both have the same expected picture.

    That is in a scene without media (of which this renderer has none) and without BSDFs
    that their shadow rays see through.
    """
    if scene is None:
        return _refused(element, "is not supported here")
    plugins = {e.plugin: e for e in _below(scene) if e.tag == "bsdf"}
    through = next((plugins[name] for name in _SEEN_THROUGH if name in plugins), None)
    if through is not None:
        return _refused(
            element,
            f"is not supported where light passes {through} ({through.location}): its "
            "shadow rays do so too, those of path do not",
        )
    properties = Properties(element, reading)
    integrator = dataclasses.replace(_path(properties), stands_for=element.plugin)
    if element.plugin == "volpathmis":
        properties.boolean("use_spectral_mis", True)  # of media
    integrator = _with_work(integrator, properties)
    properties.finish()
    reading.warn(
        element.location,
        f"{element} is rendered by path: without media both have the same expected picture",
    )
    return integrator


def _below(element: Element) -> Iterator[Element]:
    """Yield an element and all that are inside of it or referenced, each once."""
    seen: set[int] = set()
    waiting = [element]
    while waiting:
        current = waiting.pop()
        if id(current) not in seen:
            seen.add(id(current))
            yield current
            values = (property_.value for property_ in current.properties.values())
            waiting += [value for value in values if isinstance(value, Element)]


def _moment(properties: Properties, scene: Element | None) -> Integrator:
    """Read `moment`: the integrator inside of it, with second moments beside it."""
    element = properties.element
    children = properties.children("integrator")
    if len(children) != 1:
        raise SceneError(
            f"{element.location}: {element} holds {len(children)} integrators; expected one"
        )
    key, child = children[0]
    inner = read_integrator(child, properties.reading, scene)
    nested = inner.nested
    if inner.moments is not None or (nested is not None and nested.moments is not None):
        raise SceneError(
            f"{child.location}: {element} around another one is not supported; "
            "expected path, direct, whitted, depth, or aov around one of them"
        )
    name = _shown_name(element, key)
    if nested is not None:
        below = next(
            key
            for key, property_ in child.properties.items()
            if isinstance(property_.value, Element)
        )
        moments = Moments(name, colors=_shown_name(child, below))
        nested = dataclasses.replace(nested, moments=moments)
    properties.boolean("hide_emitters", False)  # that of the integrator inside counts
    inner = dataclasses.replace(inner, moments=Moments(name), nested=nested)
    inner = _with_work(inner, properties)
    properties.finish()
    return inner


def _shown_name(element: Element, key: str) -> str:
    """Return the name that channels of a nested element begin with, as in Mitsuba."""
    if not key.startswith(UNNAMED):
        return key
    unnamed = [name for name in element.properties if name.startswith(UNNAMED)]
    return f"_arg_{unnamed.index(key)}"


def _direct(properties: Properties) -> Integrator:
    both = properties.has("shading_samples")
    separate = [n for n in ("emitter_samples", "bsdf_samples") if properties.has(n)]
    if both and separate:
        properties.fail(separate[0], 'a value beside "shading_samples"', "one of the two")
    shared = properties.integer("shading_samples", 1, at_least=1, at_most=_MOST)
    # Mitsuba takes 0 and then shows no point light; nobody can want that
    emitter_samples = properties.integer(
        "emitter_samples", shared, at_least=1, at_most=_MOST
    )
    bsdf_samples = properties.integer("bsdf_samples", shared, at_least=0, at_most=_MOST)
    return Integrator(
        "direct",
        max_depth=2,
        hide_emitters=properties.boolean("hide_emitters", False),
        emitter_samples=emitter_samples,
        bsdf_samples=bsdf_samples,
    )


def _aov(properties: Properties, scene: Element | None) -> Integrator:
    if not properties.has("aovs"):
        properties.fail("aovs", "nothing", 'a list like "dd:depth, nn:sh_normal"')
    aovs: list[tuple[str, str]] = []
    for entry in split_list(properties.string("aovs", "")):
        name, _, kind = entry.partition(":")
        if not name or kind not in AOV_KINDS:
            properties.fail(
                "aovs", quoted(entry), "name:kind with a kind of " + ", ".join(AOV_KINDS)
            )
        if name in (known for known, _ in aovs):
            properties.fail("aovs", f"the name {quoted(name)} twice", "different names")
        aovs.append((name, kind))
    if not aovs:
        properties.fail("aovs", "an empty list", 'a list like "dd:depth, nn:sh_normal"')
    child = properties.child("integrator")
    nested = None if child is None else read_integrator(child, properties.reading, scene)
    if child is not None and nested is not None:
        if nested.name == "aov":
            raise SceneError(
                f"{child.location}: an aov integrator inside of another one is not "
                "supported; write all aovs in one list"
            )
        if nested.moments is not None:
            names = properties.element.properties.items()
            key = next(key for key, property_ in names if property_.value is child)
            within = f"{_shown_name(properties.element, key)}."
            moments = dataclasses.replace(nested.moments, within=within)
            nested = dataclasses.replace(nested, moments=moments)
    return Integrator(
        "aov",
        hide_emitters=properties.boolean("hide_emitters", False),
        aovs=tuple(aovs),
        nested=nested,
        refusal="" if nested is None else nested.refusal,
    )
