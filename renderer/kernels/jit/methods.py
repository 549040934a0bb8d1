"""Kernels that are called by their address, as methods of an object are.

A scene is made of kinds (of BSDFs, lights, shapes, ...), each with kernels of its own. What
is common to all scenes calls these through addresses that lie in the scene's tables: so it
is compiled once, whatever kinds there are, and a new kind compiles nothing but its own
kernels. A call costs about 0.1 microseconds; a method works on a whole batch of paths.

    @method_kernel
    def closest_hit(table, rays, first, count): ...

    method = compile_method(closest_hit, packed_table, rays_type, types.int64, types.int64)
    call(method.address, method.record, (rays, first, count))      # inside a kernel

An address checks nothing: what a method is compiled for must be what it is called with.
`compile_method` is therefore given the very types (`rendering.tables` takes them from the
records themselves), and `call` refuses integers of any other kind than int64: of
a narrower one half the argument's register would be undefined.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from renderer.kernels.jit.records import Packed


class Method(NamedTuple):
    """Machine code, and the record that it works on."""

    address: int
    record: int


def compile_method(
    dispatcher: Any, record: Packed, *arguments: Any, returns: Any = types.none
) -> Method:
    """Compile a method for a record, or load it from the cache.

    Parameters
    ----------
    dispatcher
        Made by `method_kernel`.
    record
        What its first parameter will be; must be kept alive as long as the method is used.
    *arguments
        Numba types of the others.
    returns
        Numba type of what it must return.

    Raises
    ------
    TypeError
        If it returns something else: a caller would misread it.
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


_NUMBERS = (types.int64, types.float32, types.float64)  # that methods take


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
