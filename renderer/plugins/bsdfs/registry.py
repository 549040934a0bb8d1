"""Registers all kinds of BSDF with the scene reader, the planner and the stages."""

from __future__ import annotations

import inspect
import uuid
import warnings
from collections import ChainMap
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from renderer.errors import SceneError
from renderer.kernels.jit.cache import file_digest
from renderer.plugins.bsdfs.blend import BLEND
from renderer.plugins.bsdfs.bumpmap import BUMP_MAP
from renderer.plugins.bsdfs.conductor import CONDUCTOR
from renderer.plugins.bsdfs.dielectric import DIELECTRIC
from renderer.plugins.bsdfs.diffuse import DIFFUSE
from renderer.plugins.bsdfs.hair import HAIR
from renderer.plugins.bsdfs.kind import BsdfKind, Color, around, register_kernels
from renderer.plugins.bsdfs.mask import MASK
from renderer.plugins.bsdfs.measured import MEASURED
from renderer.plugins.bsdfs.merl import MERL
from renderer.plugins.bsdfs.normalmap import NORMAL_MAP
from renderer.plugins.bsdfs.null import NULL
from renderer.plugins.bsdfs.old_delta_lobes import register_old_kernels, whole_sample
from renderer.plugins.bsdfs.plastic import PLASTIC
from renderer.plugins.bsdfs.polarizer import CIRCULAR, POLARIZER, RETARDER
from renderer.plugins.bsdfs.pplastic import PPLASTIC
from renderer.plugins.bsdfs.principled import PRINCIPLED
from renderer.plugins.bsdfs.principledthin import PRINCIPLEDTHIN
from renderer.plugins.bsdfs.registration import (
    check_kernels,
    check_name,
    check_new,
    check_parameters,
    checked_reader,
)
from renderer.plugins.bsdfs.roughconductor import ROUGHCONDUCTOR
from renderer.plugins.bsdfs.roughdielectric import ROUGHDIELECTRIC
from renderer.plugins.bsdfs.roughplastic import ROUGHPLASTIC
from renderer.plugins.bsdfs.thindielectric import THIN_DIELECTRIC
from renderer.plugins.bsdfs.twosided import ONE_FOR_BOTH, ONE_FOR_EACH
from renderer.scene_file.description import OtherBsdf, TwoSided
from renderer.scene_file.objects.objects import read_bsdf, read_scalar_texture, read_texture

BSDFS: dict[str, BsdfKind] = {}
VARIANTS: dict[str, BsdfKind] = {}  # variants of them, which files cannot name
WRAPPERS: dict[str, BsdfKind] = {}  # kinds with nested BSDFs
# names in scene files, for the reader
PLUGINS: ChainMap[str, BsdfKind] = ChainMap(WRAPPERS, BSDFS)


def _register(kind: BsdfKind) -> None:
    register_kernels(kind)
    if kind.opaque:
        kind = replace(kind, read=_reader_of_opaque(kind))
    (WRAPPERS if kind.nested_fields else BSDFS)[kind.name] = kind
    for variant in kind.variants:
        register_kernels(variant)
        VARIANTS[variant.name] = variant


def _reader_of_opaque(kind: BsdfKind) -> Callable[[Any], Any]:
    """Return the `read` of a kind that refuses nested BSDFs with transmission."""

    def read(properties: Any) -> Any:
        description = kind.read(properties)
        for _, element in properties.children("bsdf"):
            # reads the same record as before, see `Reading.once`
            if kind_of(read_bsdf(element, properties.reading)).transmits:
                possible = [name for name, other in BSDFS.items() if not other.transmits]
                raise SceneError(
                    f"{element.location}: {element} cannot be inside of {kind.name}, as "
                    f"light goes through it; supported: {', '.join(possible)} and what "
                    "holds these"
                )
        return description

    return read


for _kind in (
    DIFFUSE,
    CONDUCTOR,
    DIELECTRIC,
    ROUGHCONDUCTOR,
    ROUGHDIELECTRIC,
    PLASTIC,
    ROUGHPLASTIC,
    PPLASTIC,
    PRINCIPLED,
    PRINCIPLEDTHIN,
    THIN_DIELECTRIC,
    NULL,
    POLARIZER,
    CIRCULAR,
    RETARDER,
    MERL,
    HAIR,
    MEASURED,
    ONE_FOR_BOTH,
    ONE_FOR_EACH,
    MASK,
    BLEND,
    NORMAL_MAP,
    BUMP_MAP,
):
    _register(_kind)
_OURS = tuple(PLUGINS)


def register_bsdf(
    name: str,
    parameters: type,
    *,
    sample: Any,
    eval_pdf: Any = None,
    albedo: Any = None,
    delta: bool = False,
    transmits: bool = False,
    read: Callable[[Any], Any] | None = None,
    about: str = "",
    reflection: Any = None,
    transmission: Any = None,
) -> None:
    """Make a BSDF of your own known: scenes can then say `<bsdf type="name">`.

    `docs/adding-a-bsdf.md` walks through one. Kernels are made with `renderer.kernel`, work
    on 16 points at once, and see directions in the local frame, where z is the shading
    normal (`renderer.plugins.bsdfs.kind`).

    Parameters
    ----------
    name : str
        Name of the plugin.
    parameters : type
        A NamedTuple class. Its fields are annotated `Color` or `Float`; a default
        applies if a file does not give the property.
    sample : kernel
        (parameters, wo, numbers) -> BsdfSample. If there are two delta lobes, the
        smallest `numbers.choice` selects one and the largest the other, as Whitted's
        trees need.
    eval_pdf : kernel, optional
        (parameters, wo, wi) -> f |cos| (RGB), pdf [1/sr]; None if all lobes are delta
        lobes.
    albedo : kernel, optional
        parameters -> RGB, for the AOV; None: black.
    delta : bool
        Whether there are delta lobes; samples must then have their `lobe`.
    transmits : bool
        Whether it transmits light.
    read : callable, optional
        Makes the description from `Properties`; None reads each parameter by its name.
    about : str
        A few words for `--explain`.
    reflection, transmission : kernel, optional
        The delta lobes in the form of version 1, see `old_delta_lobes`; they work for one
        more version, with a FutureWarning.

    Raises
    ------
    PluginError
        If the name is one of the renderer's own or given twice in one file; if there is
        neither `eval_pdf` nor `delta`; if a function is not a kernel or takes other
        arguments; if `transmission` comes without `reflection` or `transmits`; or if
        the parameters are not a NamedTuple class of `Color` and `Float` with numbers as
        defaults, or belong to another kind. Results of the kernels are checked when a
        scene is rendered.
    """
    kernels = {
        "sample": sample,
        "eval_pdf": eval_pdf,
        "reflection": reflection,
        "transmission": transmission,
        "albedo": albedo,
    }
    check_name(name, _OURS)
    check_kernels(name, kernels, transmits=transmits, delta=delta)
    hints = check_parameters(name, parameters)
    check_new(name, parameters, kernels, BSDFS)
    if read is not None:
        read = checked_reader(name, parameters, read, PLUGINS)
    defaults: dict[str, float] = getattr(parameters, "_field_defaults", {})

    def read_by_name(properties: Any) -> OtherBsdf:
        values: dict[str, Any] = {}
        for key, kind in hints.items():
            default = float(defaults.get(key, 0.5 if kind is Color else 0.0))
            values[key] = (
                read_texture(properties, key, default)
                if kind is Color
                else read_scalar_texture(properties, key, default)
            )
        return OtherBsdf(name, values)

    if reflection is not None:
        warnings.warn(
            f"BSDF {name!r}: reflection and transmission will go; give delta=True, and let "
            "sample return the direction, the probability and the lobe of a delta lobe",
            FutureWarning,
            stacklevel=2,
        )
        register_old_kernels(parameters, sample, reflection, transmission)
    given = {key: kernel for key, kernel in kernels.items() if kernel is not None}
    _register(
        BsdfKind(
            name,
            parameters,
            read or read_by_name,
            about or "a kind of your own",
            sample if reflection is None else whole_sample,
            eval_pdf,
            albedo,
            delta=delta or reflection is not None,
            transmits=transmits,
            # cached kernels are found by the module that defines them
            source=_source_of([kernel.py_func for kernel in given.values()]),
            users_kernels=tuple(given.items()),
        )
    )


def kind_of(bsdf: Any) -> BsdfKind:
    """Return the kind of a BSDF of the scene description, including its nested BSDFs."""
    if (kind := BSDFS.get(bsdf.plugin) or VARIANTS.get(bsdf.plugin)) is not None:
        return kind
    kind = WRAPPERS[bsdf.plugin]
    if isinstance(bsdf, TwoSided) and bsdf.front is bsdf.back:
        kind = ONE_FOR_BOTH
    return around(kind, tuple(kind_of(getattr(bsdf, name)) for name in kind.nested_fields))


def reaches_all(bsdf: Any) -> bool:
    """Return whether BSDF samples alone reach all light that it reflects.

    False for a user's BSDF: it may need light samples.
    """
    if names := nested_names(bsdf):
        return all(reaches_all(getattr(bsdf, name)) for name in names)
    kind = kind_of(bsdf)
    return not kind.source and (kind.reaches_all is None or kind.reaches_all(bsdf))


def nested_names(bsdf: Any) -> tuple[str, ...]:
    """Return the attributes of a BSDF of the description that are nested BSDFs."""
    kind = WRAPPERS.get(bsdf.plugin)
    return () if kind is None else kind.nested_fields


def _source_of(functions: list[Any]) -> str:
    """Return an identifier of the source of kernels, which changes with their files.

    Functions that were defined at a prompt have a new one each time.
    """
    found = {function.__module__: inspect.getfile(function) for function in functions}
    digests = [
        f"{module} {file_digest(file) if Path(file).is_file() else uuid.uuid4().hex}"
        for module, file in sorted(found.items())
    ]
    return " ".join(digests)
