"""Functions with one name and several implementations, chosen when a kernel is compiled.

    @interface
    def area_of(shape, index): "Return the area of a primitive."

    @area_of.by(Spheres)
    @kernel
    def _area_of_sphere(spheres, index): ...

The choice goes by the class of the record that is the first argument: there is no branch at
run time, and what nobody calls is never compiled.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from numba.core.errors import TypingError
from numba.extending import overload

from renderer.jit.decorators import kernel
from renderer.jit.records import record_class


def interface(declared: Callable[..., Any]) -> Any:
    """Make a function that is implemented for records of several classes.

    Parameters
    ----------
    declared
        Gives the name, the parameters and the description; its body is never run.

    Returns
    -------
    callable
        To be called inside kernels. Its `by(*classes)` is a decorator that adds an
        implementation, which is not given the record itself if `drop_first`. `has(cls)`
        tells whether there is one.
    """
    names = list(inspect.signature(declared).parameters)
    listed = ", ".join(names)
    implementations: dict[type, tuple[Any, str]] = {}  # and the arguments it is given

    def refuse(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{declared.__name__} can be called inside kernels only")

    # Numba compares the parameters' names, so both functions must have the declared ones
    function: Any = eval(f"lambda {listed}: _refuse({listed})", {"_refuse": refuse})
    function.__name__ = function.__qualname__ = declared.__name__
    function.__module__, function.__doc__ = declared.__module__, declared.__doc__

    def implementation(first: Any) -> Any:
        cls = record_class(first)
        if cls is None or cls not in implementations:
            known = ", ".join(c.__name__ for c in implementations)
            raise TypingError(f"{declared.__name__} exists for {known}, not for {first}")
        chosen, given = implementations[cls]
        if getattr(chosen, "is_compiling", False):
            # A record within a record of its class, as a mask's in a mask. Numba would take
            # it for a function that calls itself, and not link the inner one.
            chosen = kernel(chosen.py_func)
        return eval(f"lambda {listed}: _chosen({given})", {"_chosen": chosen})

    choose = eval(
        f"lambda {listed}: _implementation({names[0]})", {"_implementation": implementation}
    )
    overload(function)(choose)

    def by(*classes: type, drop_first: bool = False) -> Any:
        given = ", ".join(names[1:] if drop_first else names)

        def add(chosen: Any) -> Any:
            for cls in classes:
                implementations[cls] = chosen, given
            return chosen

        return add

    function.by, function.has = by, implementations.__contains__
    return function
