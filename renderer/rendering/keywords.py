"""Functions whose keyword arguments are the fields of `RenderOptions`."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import textwrap
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar, overload

from renderer.errors import did_you_mean
from renderer.rendering.render_options import OPTIONS, RenderOptions

P = ParamSpec("P")
Made = TypeVar("Made")
A = TypeVar("A")
B = TypeVar("B")
R = TypeVar("R")


@overload
def with_keywords(
    make: Callable[P, Made], call: Callable[[A, Made], R], name: str
) -> Callable[Concatenate[A, P], R]: ...
@overload
def with_keywords(
    make: Callable[P, Made], call: Callable[[A, B, Made], R], name: str
) -> Callable[Concatenate[A, B, P], R]: ...
def with_keywords(
    make: Callable[..., Any], call: Callable[..., Any], name: str
) -> Callable[..., Any]:
    """Return a function with options as keyword arguments, from one with an object.

    Parameters
    ----------
    make
        `RenderOptions`; its fields become parameters, for type checkers too.
    call
        Its last parameter is the object of options. `{options}` in its docstring is
        replaced by their documentation.
    name
        Name of the new function.
    """
    *first, _ = inspect.signature(call).parameters.values()
    signature = inspect.signature(call).replace(
        parameters=[*first, *inspect.signature(make).parameters.values()]
    )

    @functools.wraps(call)
    def function(*arguments: Any, **keywords: Any) -> Any:
        try:
            bound = signature.bind(*arguments, **keywords).arguments
        except TypeError as error:
            known = signature.parameters
            near = [did_you_mean(word, known) for word in keywords if word not in known]
            raise TypeError(f"{name}(): {error}{''.join(near[:1])}") from None
        return call(*(bound.pop(each.name) for each in first), make(**bound))

    function.__name__ = function.__qualname__ = name
    function.__signature__ = signature  # type: ignore[attr-defined]
    function.__doc__ = (call.__doc__ or "").replace("{options}", _documentation(), 1)
    return function


@functools.cache
def _documentation() -> str:
    """Return the options as parameters of a NumPy-style docstring."""
    text = []
    for field in dataclasses.fields(RenderOptions):
        text.append(f"{field.name} : {field.type}, default {field.default!r}")
        option = OPTIONS[field.name]
        told = option.help if option.choices else option.help[0].upper() + option.help[1:]
        text += textwrap.wrap(f"{told}.", 84, break_on_hyphens=False, **_INDENTED)
    return "\n    ".join(text)


_INDENTED: Any = {"initial_indent": " " * 4, "subsequent_indent": " " * 4}
