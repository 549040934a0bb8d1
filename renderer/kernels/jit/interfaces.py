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

import functools
import inspect
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global

from renderer.kernels.jit.decorators import kernel
from renderer.kernels.jit.records import record_class


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
        implementation, which is not given the record itself if `drop_first`; `has(cls)`
        tells whether there is one.
    """
    parameters = inspect.signature(declared)
    # of each class: the implementation, and how many arguments it is not given
    implementations: dict[type, tuple[Any, int]] = {}
    copies: dict[Any, Any] = {}  # of implementations, by the Numba type of the record

    @functools.wraps(declared)
    def function(*args: Any, **kwargs: Any) -> None:
        raise TypeError(f"{declared.__name__} can be called inside kernels only")

    def implementation(first: Any) -> tuple[Any, int]:
        cls = record_class(first)
        if cls is None or cls not in implementations:
            known = ", ".join(c.__name__ for c in implementations)
            raise TypingError(f"{declared.__name__} exists for {known}, not for {first}")
        chosen, left_out = implementations[cls]
        if first not in copies and getattr(chosen, "is_compiling", False):
            # A record within a record of its class, as a mask's in a mask. Numba would take
            # it for a function that calls itself, and not link the inner one.
            copies[first] = kernel(chosen.py_func)
        return copies.get(first, chosen), left_out

    class Choice(AbstractTemplate):  # type: ignore[misc]  # Numba has no types
        """Type a call as a call of the implementation: no function between the two."""

        key = function

        def generic(self, args: Any, kws: Any) -> Signature:
            args = parameters.bind(*args, **kws).args
            chosen, left_out = implementation(args[0])
            typed = self.context.resolve_function_type(chosen, args[left_out:], {})
            of_all = (*args[:left_out], *typed.args)
            return Signature(typed.return_type, of_all, None, pysig=parameters)

    infer_global(function, types.Function(Choice))

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        chosen, left_out = implementation(sig.args[0])
        inner = Signature(sig.return_type, sig.args[left_out:], None)
        kernel_type = context.typing_context.resolve_value_type(chosen)
        context.typing_context.resolve_function_type(kernel_type, inner.args, {})
        return context.get_function(kernel_type, inner)(builder, args[left_out:])

    lower_builtin(function, types.VarArg(types.Any))(lower)

    def by(*classes: type, drop_first: bool = False) -> Any:
        def add(chosen: Any) -> Any:
            copies.clear()
            for cls in classes:
                implementations[cls] = chosen, int(drop_first)
            return chosen

        return add

    function.by = by  # type: ignore[attr-defined]
    function.has = implementations.__contains__  # type: ignore[attr-defined]
    return function
