"""Machine operations that numba lacks; addresses are integers."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import extending, types

intrinsic: Any = extending.intrinsic  # kernels call an intrinsic without its first argument ``typing``
BYTE, STATUS, WORD, REAL = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.DoubleType()
ADDRESS = BYTE.as_pointer()
ORDER = "seq_cst"  # all threads see atomic operations in one order

# functions of the C library
sched_yield: Any = types.ExternalFunction("sched_yield", types.int32())
sem_wait: Any = types.ExternalFunction("sem_wait", types.int32(types.int64))
sem_post: Any = types.ExternalFunction("sem_post", types.int32(types.int64))
clock_gettime: Any = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.int64))
memcpy: Any = types.ExternalFunction("memcpy", types.int64(types.int64, types.int64, types.int64))


def _pointer(builder: Any, address: Any, kind: Any) -> Any:
    return builder.inttoptr(address, kind.as_pointer())


@intrinsic
def record_at(typing: Any, address: Any, dtype: Any) -> Any:
    """Return the record of a numpy dtype at an address, as a view."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

    return dtype.dtype(types.int64, dtype), emit


@intrinsic
def load_word(typing: Any, address: Any) -> Any:
    """Return the 8-byte integer at an address, which may be unaligned."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_pointer(builder, args[0], WORD), align=1)

    return types.int64(types.int64), emit


@intrinsic
def store_word(typing: Any, address: Any, value: Any) -> Any:
    """Write an 8-byte integer to an address, which may be unaligned."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[1], _pointer(builder, args[0], WORD), align=1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), emit


@intrinsic
def load_real(typing: Any, address: Any) -> Any:
    """Return the double at an address."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load(_pointer(builder, args[0], REAL))

    return types.float64(types.int64), emit


@intrinsic
def store_real(typing: Any, address: Any, value: Any) -> Any:
    """Write a double to an address."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[1], _pointer(builder, args[0], REAL))
        return context.get_dummy_value()

    return types.void(types.int64, types.float64), emit


@intrinsic
def atomic_load(typing: Any, address: Any) -> Any:
    """Return the word at an address that other threads write."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.load_atomic(_pointer(builder, args[0], WORD), ORDER, 8)

    return types.int64(types.int64), emit


@intrinsic
def atomic_store(typing: Any, address: Any, value: Any) -> Any:
    """Write a word that other threads read; earlier writes are visible to them as well."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store_atomic(args[1], _pointer(builder, args[0], WORD), ORDER, 8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), emit


@intrinsic
def compare_and_swap(typing: Any, address: Any, expected: Any, value: Any) -> Any:
    """Replace the word at an address if it equals ``expected``; returns the old word."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        swapped = builder.cmpxchg(_pointer(builder, args[0], WORD), args[1], args[2], ORDER, ORDER)
        return builder.extract_value(swapped, 0)

    return types.int64(types.int64, types.int64, types.int64), emit


def _call(builder: Any, function: Any, kinds: list[Any], values: list[Any]) -> Any:
    """Emit the call of an FMI function at an address; its status is returned as a word."""
    pointer = builder.inttoptr(function, ir.FunctionType(STATUS, kinds).as_pointer())
    arguments = [
        builder.inttoptr(value, kind) if kind == ADDRESS else value for value, kind in zip(values, kinds, strict=True)
    ]
    return builder.sext(builder.call(pointer, arguments), WORD)


@intrinsic
def call_exchange(typing: Any, function: Any, instance: Any, references: Any, n: Any, values: Any) -> Any:
    """Call fmi2SetReal or fmi2GetReal by address; returns the FMI status."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _call(builder, args[0], [ADDRESS, ADDRESS, WORD, ADDRESS], args[1:])

    return types.int64(*[types.int64] * 5), emit


@intrinsic
def call_do_step(typing: Any, function: Any, instance: Any, t: Any, h: Any, no_rollback: Any) -> Any:
    """Call fmi2DoStep by address; returns the FMI status."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        flag = builder.trunc(args[4], STATUS)
        return _call(builder, args[0], [ADDRESS, REAL, REAL, STATUS], [*args[1:4], flag])

    return types.int64(types.int64, types.int64, types.float64, types.float64, types.int64), emit
