"""Checks of a BSDF that a user registers.

Nothing is compiled here, so a plugin file is imported in a few milliseconds. The results of
the kernels are checked when a scene is rendered (`rendering.user_kernels`).
"""

from __future__ import annotations

import inspect
import numbers
from collections.abc import Callable, Container, Mapping
from typing import Any

import numpy as np

from renderer.errors import PluginError, SceneError
from renderer.plugins.bsdfs.parameters import Color, Float, hints_of
from renderer.plugins.textures.registry import kind_of_texture
from renderer.process.source_places import (
    class_definition_of,
    definition_of,
    place_of_error,
)
from renderer.scene_file.description import OtherBsdf

MOST = float(np.finfo(np.float32).max)  # a parameter is a float32

# arguments of each kernel; the last one of `albedo` is optional
CALLED_WITH = {
    "sample": ("parameters", "wo", "numbers"),
    "eval_pdf": ("parameters", "wo", "wi"),
    "reflection": ("parameters", "wo"),
    "transmission": ("parameters", "wo"),
    "albedo": ("parameters", "wo"),
}


def check_name(name: Any, own: tuple[str, ...]) -> None:
    """Refuse names that no plugin can have, and names of the renderer's own plugins."""
    if not isinstance(name, str) or not name.strip():
        raise PluginError(f"the name of a BSDF is a text such as 'velvet', not {name!r}")
    if name in own:
        raise PluginError(f"BSDF {name!r} is the renderer's own; choose another name")


def check_kernels(name: str, kernels: Mapping[str, Any], **flags: Any) -> None:
    """Refuse objects that are not kernels, wrong arguments, and invalid combinations.

    Parameters
    ----------
    kernels
        By the names in `CALLED_WITH`; None for an absent one.
    **flags
        `transmits` and `delta` of `register_bsdf`.
    """
    for key, value in flags.items():
        if not isinstance(value, bool):
            raise PluginError(f"BSDF {name!r}: {key} is {value!r}; it is True or False")
    given = {key: kernel for key, kernel in kernels.items() if kernel is not None}
    if "sample" not in given:
        raise PluginError(f"BSDF {name!r} has no sample")
    if not given.keys() - {"sample", "albedo"} and not flags["delta"]:
        raise PluginError(f"BSDF {name!r} has neither eval_pdf nor a delta lobe")
    for key, kernel in given.items():
        if not hasattr(kernel, "py_func"):
            raise PluginError(
                f"BSDF {name!r}: {key}: "
                f"{getattr(kernel, '__name__', type(kernel).__name__)!r} is no kernel; "
                "decorate it with renderer.kernel",
                definition_of(kernel),
            )
    if "transmission" in given and ("reflection" not in given or not flags["transmits"]):
        raise PluginError(
            f"BSDF {name!r}: transmission needs transmits=True, and reflection as well"
        )
    for key, kernel in given.items():
        _check_arguments(name, key, kernel)


def _check_arguments(name: str, key: str, kernel: Any) -> None:
    expected = CALLED_WITH[key]
    signature = inspect.signature(kernel.py_func)
    counts = [len(expected), len(expected) - 1] if key == "albedo" else [len(expected)]
    for count in counts:
        try:
            signature.bind(*expected[:count])
        except TypeError:
            continue
        return
    found = f"{kernel.py_func.__name__}{signature}"
    raise PluginError(
        f"BSDF {name!r}: {found} is called as {key}({', '.join(expected)})"
        + (", or without wo" if key == "albedo" else ""),
        definition_of(kernel),
    )


def check_parameters(name: str, parameters: Any) -> Mapping[str, type]:
    """Return the annotations of the parameters, in their order."""
    is_class = isinstance(parameters, type)
    if not (is_class and issubclass(parameters, tuple) and hasattr(parameters, "_fields")):
        raise PluginError(
            f"BSDF {name!r}: the parameters are no NamedTuple class but {parameters!r}"
        )
    place = class_definition_of(parameters)

    def fail(what: str) -> PluginError:
        return PluginError(f"BSDF {name!r}: {what}", place)

    try:
        hints = hints_of(parameters)
    except NameError as error:
        raise fail(f"an annotation of {parameters.__name__} is unknown: {error}") from error
    defaults: Mapping[str, Any] = getattr(parameters, "_field_defaults", {})
    for key in parameters._fields:
        kind = hints.get(key)
        if kind not in (Color, Float):
            raise fail(
                f"{key} is annotated neither Color nor Float of "
                f"renderer.plugins.bsdfs.kind, but {getattr(kind, '__name__', kind)}"
            )
        if key in vars(OtherBsdf) or key in OtherBsdf.__annotations__:
            raise fail(f"a parameter cannot be called {key!r}; choose another name")
        default = defaults.get(key, 0.0)
        least = 0.0 if kind is Color else -MOST
        is_number = isinstance(default, numbers.Real) and not isinstance(default, bool)
        if not (is_number and least <= default <= MOST):
            shown = repr(default)[:40]
            raise fail(
                f"the default of {key} is {shown}; it must be a finite number"
                + (" of 0 or more" if kind is Color else "")
            )
    return hints


def check_new(name: str, parameters: type, kernels: Mapping[str, Any], known: Any) -> None:
    """Refuse a parameter class of another kind, and a name that one file registers twice.

    A kind may be registered again, as at a prompt or when its module is reloaded. Two kinds
    of the same name in one file are a mistake.

    Parameters
    ----------
    known
        The registered kinds, by name.
    """
    for other in known.values():
        # the stages find a kind's kernels by the class of its parameters
        known_kernels = dict(other.users_kernels)
        same = other.name == name and all(
            known_kernels.get(key) is kernel for key, kernel in kernels.items()
        )
        if other.parameters is parameters and not same:
            raise PluginError(
                f"BSDF {name!r}: {parameters.__name__} belongs to {other.name!r} already; "
                "make a class for each kind"
            )
    before = known.get(name)
    if before is None or before.parameters is parameters:
        return
    module = inspect.getmodule(before.parameters)
    if module is None or module.__name__ == "__main__":
        return
    # a reloaded module has rebound the name of the class
    alive = getattr(module, before.parameters.__name__, None) is before.parameters
    if alive and parameters.__module__ == module.__name__:
        raise PluginError(
            f"BSDF {name!r} is registered twice in this file, with "
            f"{before.parameters.__name__} and with {parameters.__name__}; choose another "
            "name for one"
        )


def checked_reader(
    name: str, parameters: Any, read: Any, known: Container[str]
) -> Callable[[Any], Any]:
    """Return a user's `read` whose exceptions and invalid results become PluginErrors."""
    if not callable(read):
        raise PluginError(f"BSDF {name!r}: read is {read!r}, which cannot be called")

    def read_checked(properties: Any) -> Any:
        at = f"BSDF {name!r}, read() of {properties.location}"
        try:
            description = read(properties)
        except SceneError:
            raise
        except Exception as error:
            raise PluginError(
                f"{at}: {type(error).__name__}: {error}",
                place_of_error(error) or definition_of(read),
            ) from error
        plugin = getattr(description, "plugin", None)
        if plugin not in known:
            raise PluginError(
                f"{at}: it returned {description!r}; a description is needed whose "
                f"`plugin` is {name!r}, such as OtherBsdf({name!r}, values)",
                definition_of(read),
            )
        for key, kind in hints_of(parameters).items() if plugin == name else ():
            _check_value(at, read, description, key, 3 if kind is Color else 1)
        return description

    return read_checked


def _check_value(at: str, read: Any, description: Any, key: str, numbers: int) -> None:
    missing = object()
    value = getattr(description, key, missing)
    if value is missing:
        raise PluginError(f"{at}: what it returned has no {key!r}", definition_of(read))
    if kind_of_texture(value) is not None:
        return
    try:
        np.broadcast_to(np.asarray(value, np.float64), numbers)
    except (TypeError, ValueError):
        raise PluginError(
            f"{at}: {key} is {value!r}; it must be a texture of the description, a number"
            + (" or three" if numbers == 3 else ""),
            definition_of(read),
        ) from None
