"""All kinds of BSDF: one line makes a kind known to the reader, the plan and the stages."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable
from typing import Any

from renderer.jit.cache import file_digest
from renderer.kinds.bsdfs.conductor import CONDUCTOR
from renderer.kinds.bsdfs.dielectric import DIELECTRIC
from renderer.kinds.bsdfs.diffuse import DIFFUSE
from renderer.kinds.bsdfs.kind import BsdfKind, Color, Float, make_known
from renderer.scene_file.description import OtherBsdf
from renderer.scene_file.objects.textures import read_texture

BSDFS: dict[str, BsdfKind] = {}


def _register(kind: BsdfKind) -> None:
    make_known(kind)
    BSDFS[kind.name] = kind


for _kind in (DIFFUSE, CONDUCTOR, DIELECTRIC):
    _register(_kind)
_OURS = (*BSDFS, "twosided")


def register_bsdf(
    name: str,
    parameters: type,
    *,
    sample: Any,
    eval_pdf: Any = None,
    reflection: Any = None,
    transmission: Any = None,
    albedo: Any = None,
    transmits: bool = False,
    read: Callable[[Any], Any] | None = None,
    about: str = "",
) -> None:
    """Make a BSDF of your own known: scenes can then say `<bsdf type="name">`.

    `docs/adding-a-bsdf.md` walks through one. Kernels are made with `renderer.kernel`, work
    on 16 points at once, and see directions in the local frame, where z is the shading
    normal (`renderer.kinds.bsdfs.kind`).

    Parameters
    ----------
    name : str
        Of the plugin.
    parameters : type
        A NamedTuple class. Its fields are annotated `Color` or `Float`; a default is what
        a file that does not give the property means.
    sample : kernel
        (parameters, wo, numbers) -> BsdfSample.
    eval_pdf : kernel, optional
        (parameters, wo, wi) -> f |cos| (RGB), density [1/sr]; None where there are delta
        lobes only.
    reflection, transmission : kernel, optional
        (parameters, wo) -> Branch, the delta lobes; Whitted's trees follow them.
    albedo : kernel, optional
        parameters -> RGB, for the AOV; black without it.
    transmits : bool
        Whether light goes through.
    read : callable, optional
        Makes the description from `Properties`; None reads each parameter by its name.
    about : str
        A few words for `--explain`.

    Raises
    ------
    ValueError
        If the name is one of the renderer's own, nothing scatters, or the parameters are no
        NamedTuple class of `Color` and `Float`.
    """
    if name in _OURS:
        raise ValueError(f"BSDF {name!r} is the renderer's own; choose another name")
    if eval_pdf is None and reflection is None and transmission is None:
        raise ValueError(f"BSDF {name!r} has neither eval_pdf nor a delta lobe")
    hints = _checked_parameters(name, parameters)
    defaults: dict[str, float] = getattr(parameters, "_field_defaults", {})

    def read_by_name(properties: Any) -> OtherBsdf:
        values: dict[str, Any] = {}
        for key, kind in hints.items():
            default = float(defaults.get(key, 0.5 if kind is Color else 0.0))
            values[key] = (
                read_texture(properties, key, default)
                if kind is Color
                else properties.number(key, default)
            )
        return OtherBsdf(name, values)

    _register(
        BsdfKind(
            name,
            parameters,
            read or read_by_name,
            about or "a kind of your own",
            sample,
            eval_pdf,
            reflection,
            transmission,
            albedo,
            transmits,
            # compiled kernels name the module that they come from, and are found by it
            source=f"{sample.__module__} {file_digest(inspect.getfile(sample.py_func))}",
        )
    )


def _checked_parameters(name: str, parameters: type) -> dict[str, type]:
    """Return the annotations of the parameters, in their order."""
    if not (isinstance(parameters, type) and hasattr(parameters, "_fields")):
        raise ValueError(f"BSDF {name!r}: the parameters are no NamedTuple class")
    hints = typing.get_type_hints(parameters)
    for key, kind in hints.items():
        if kind not in (Color, Float):
            raise ValueError(f"BSDF {name!r}: {key} is annotated neither Color nor Float")
    return hints
