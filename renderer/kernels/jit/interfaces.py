"""Calls resolved by type at compile time, and calls by address at run time."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global
from numba.extending import intrinsic

from renderer.kernels.jit.decorators import kernel
from renderer.kernels.jit.records import Packed, record_class

# --------------------------------------------------------------------------- interfaces
# Functions with one name and several implementations, selected at compile time.
#
#     @interface
#     def area_of(shape, index): "Return the area of a primitive."
#
#     @area_of.by(Spheres)
#     @kernel
#     def _area_of_sphere(spheres, index): ...
#
# The class of the first argument, a record, selects the implementation. There is no branch
# at run time, and an implementation without a caller is never compiled.


def interface(declared: Callable[..., Any]) -> Any:
    """Make a function that has one implementation per class of record.

    Parameters
    ----------
    declared
        Gives the name, the parameters and the docstring; its body is never run.

    Returns
    -------
    callable
        For calls inside kernels. Its `by(*classes)` is a decorator that adds an
        implementation; with `drop_first` that does not get the record as an argument.
        `has(cls)` tells whether a class has an implementation.
    """
    parameters = inspect.signature(declared)
    # class -> implementation, and the number of leading arguments that it does not get
    implementations: dict[type, tuple[Any, int]] = {}
    copies: dict[Any, Any] = {}  # of implementations, by Numba type of the record

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
            # Recursive types, such as a mask inside a mask: Numba would see a function
            # that calls itself, and not link the inner one.
            copies[first] = kernel(chosen.py_func)
        return copies.get(first, chosen), left_out

    class Choice(AbstractTemplate):  # type: ignore[misc]  # Numba has no types
        """Type a call as a call of the implementation itself."""

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


# ------------------------------------------------------------------------------ methods
# Kernels called by address, like the methods of an object.
#
# A scene has kinds of BSDFs, lights, shapes and so on, each with kernels of its own. The
# stages call these through addresses in the scene's tables. So the stages are compiled
# once for all scenes, and a new kind compiles only its own kernels. A call costs about
# 0.1 microseconds; a method works on a whole batch of paths.
#
#     @method_kernel
#     def closest_hit(table, rays, first, count): ...
#
#     method = compile_method(closest_hit, packed_table, rays_type, int64, int64)
#     call(method.address, method.record, (rays, first, count))      # inside a kernel
#
# A call by address checks nothing: the argument types must be those that the method was
# compiled for. So `compile_method` gets the types of the records themselves
# (`rendering.tables`), and `call` accepts no integers but int64: of a narrower one half
# the argument's register would be undefined.


class Method(NamedTuple):
    """The address of machine code, and of the record that it works on."""

    address: int
    record: int


def compile_method(
    dispatcher: Any, record: Packed, *arguments: Any, returns: Any = types.none
) -> Method:
    """Compile a method for a record, or load it from the cache.

    Parameters
    ----------
    dispatcher
        Result of `method_kernel`.
    record
        Its first argument; it must be kept alive as long as the method is used.
    *arguments
        Numba types of the other arguments.
    returns
        Numba type of the required result.

    Raises
    ------
    TypeError
        If it returns another type, which a caller would misread.
    """
    signature = (record.numba_type, *arguments)
    compiled = dispatcher.overloads.get(signature)
    if compiled is None:
        dispatcher.compile(signature)
        compiled = dispatcher.overloads[signature]
    found = compiled.signature.return_type
    if found != returns:
        raise TypeError(f"{dispatcher.__name__} returns {found}, not {returns}")
    engine = compiled.library._codegen._engine
    address = engine.get_function_address(compiled.fndesc.llvm_func_name)
    if address == 0:
        raise TypeError(f"{dispatcher.__name__} has no machine code of its own")
    return Method(address, record.address)


_NUMBERS = (types.int64, types.float32, types.float64)  # accepted by methods


def _caller(returns: Any) -> Any:
    @intrinsic
    def call(typingctx: Any, address: Any, record: Any, arguments: Any) -> Any:
        if not isinstance(arguments, types.BaseTuple):
            return None
        for part in arguments.types:
            if isinstance(part, types.Number) and part not in _NUMBERS:
                raise TypingError(f"methods take int64 and floats, not {part}")
        given = [types.voidptr, *arguments.types]

        def codegen(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            code, pointer, rest = values
            parts = [builder.extract_value(rest, k) for k in range(len(arguments.types))]
            convention = context.call_conv
            function = convention.get_function_type(returns, given)
            status, value = convention.call_function(
                builder,
                builder.inttoptr(code, function.as_pointer()),
                returns,
                given,
                [builder.inttoptr(pointer, ir.IntType(8).as_pointer()), *parts],
            )
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return value

        return returns(address, record, arguments), codegen

    return call


call = _caller(types.none)
call.__doc__ = "Call the method at an address with its record's address and a tuple."
count_of = _caller(types.int64)
count_of.__doc__ = "Call, as `call` does, a method that returns a number of rays."
