"""Named tuples of arrays and numbers passed to kernels by reference: one argument, whatever is in them.

numba passes a named tuple as its fields, and an array as seven numbers. Each kernel that passes a tuple on repeats all
of them, and an entry from Python checks each array. By reference a kernel gets the address of the tuple in memory and
reads the fields that it names, as numba lays them out there. The fields do not change, and the arrays stay the same
objects; in a kernel that is ``noalias`` the compiler knows that, because the address is a pointer.
"""

from __future__ import annotations

import struct
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numba import extending, typeof, types
from numba.core import cgutils, imputils
from numba.core.registry import cpu_target
from numba.core.typing.templates import AttributeTemplate, infer_getattr

FORMATS = {types.float64: "d", types.int64: "q", types.boolean: "?"}
Tuple = TypeVar("Tuple", bound=tuple[Any, ...])


def by_reference(parts: Tuple) -> Tuple:
    """Return a reference to ``parts``, with their fields and ``_replace``, but without their order."""
    found: Any = Reference(parts)
    return found


class ReferenceType(types.Type):  # type: ignore[misc]
    """numba's type of a tuple by reference."""

    def __init__(self, parts: Any) -> None:
        self.types = (parts,)
        super().__init__(f"Reference({parts})")


class Reference:
    """Reference to a named tuple, which is written into memory when a kernel first needs it."""

    def __init__(self, parts: Any) -> None:
        self.parts = parts  # holds the arrays

    def __getattr__(self, name: str) -> Any:
        return getattr(self.parts, name)

    def _replace(self, **fields: Any) -> Reference:
        return Reference(self.parts._replace(**fields))

    @cached_property
    def kind(self) -> ReferenceType:
        """Its type."""
        return ReferenceType(typeof(self.parts))

    @cached_property
    def address(self) -> int:
        """Place of its content."""
        return int(self._memory.ctypes.data)

    @cached_property
    def _memory(self) -> np.ndarray:
        """Copy of the numbers, of the addresses and shapes of arrays; raises TypeError for other fields."""
        (kind,), content, context = self.kind.types, bytearray(), cpu_target.target_context
        _write(content, self.parts, kind)
        size = context.get_abi_sizeof(context.get_data_type(kind))
        if len(content) != size:
            raise TypeError(f"{type(self.parts).__name__} takes {size} bytes in memory, not {len(content)}")
        return np.frombuffer(content, dtype=np.uint8)


def _of_fields(kind: Any) -> list[Any]:
    """Types of the fields of a tuple."""
    return list(kind)


def _alignment(kind: Any) -> int:
    """Alignment of a value in memory, bytes."""
    if isinstance(kind, types.BaseTuple):
        return max(map(_alignment, _of_fields(kind)), default=1)
    return 1 if kind == types.boolean else 8


def _write(memory: bytearray, value: Any, kind: Any) -> None:
    """Append a value to the memory, aligned."""
    alignment = _alignment(kind)
    memory.extend(bytes(-len(memory) % alignment))
    if isinstance(kind, types.BaseTuple):
        for part, of in zip(value, _of_fields(kind), strict=True):
            _write(memory, part, of)
        memory.extend(bytes(-len(memory) % alignment))
    elif isinstance(kind, types.Array):
        # as numba's arrays: no owner, no object; entries, bytes of one, address, shape, strides
        words = 0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides
        memory.extend(struct.pack(f"{len(words)}q", *words))
    elif isinstance(kind, ReferenceType):
        memory.extend(struct.pack("q", value.address))
    elif kind in FORMATS:
        memory.extend(struct.pack(FORMATS[kind], value))
    elif kind == types.none:
        memory.extend(bytes(8))
    else:
        raise TypeError(f"a tuple by reference holds no {kind}")


@extending.typeof_impl.register(Reference)
def _typeof(value: Reference, context: Any) -> ReferenceType:
    return value.kind


@extending.register_model(ReferenceType)
class _Address(extending.models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: ReferenceType) -> None:
        super().__init__(manager, kind, cgutils.voidptr_t)


@extending.unbox(ReferenceType)
def _unboxed(kind: ReferenceType, value: Any, c: Any) -> extending.NativeValue:
    address = c.pyapi.object_getattr_string(value, "address")
    native = c.unbox(types.intp, address)
    c.pyapi.decref(address)
    return extending.NativeValue(c.builder.inttoptr(native.value, cgutils.voidptr_t), is_error=native.is_error)


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = ReferenceType

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        (parts,) = value.types
        return parts[parts.fields.index(attr)] if attr in parts.fields else None


@extending.lower_getattr_generic(ReferenceType)
def _field(context: Any, builder: Any, kind: ReferenceType, address: Any, name: str) -> Any:
    (parts,) = kind.types
    index = parts.fields.index(name)
    memory = builder.bitcast(address, context.get_data_type(parts).as_pointer())
    value = context.unpack_value(builder, parts[index], cgutils.gep_inbounds(builder, memory, 0, index))
    return imputils.impl_ret_borrowed(context, builder, parts[index], value)


@extending.intrinsic
def refer(typing: Any, parts: Any) -> Any:
    """Reference to a tuple that a kernel has made, as long as that kernel runs."""

    def emit(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        with builder.goto_entry_block():
            memory = builder.alloca(context.get_data_type(parts))
        context.pack_value(builder, parts, args[0], memory)
        return builder.bitcast(memory, cgutils.voidptr_t)

    return ReferenceType(parts)(parts), emit


@extending.intrinsic
def after(typing: Any, pointer: Any, count: Any) -> Any:
    """Pointer to the entry that follows ``count`` entries."""
    return pointer(pointer, count), lambda context, builder, signature, args: builder.gep(args[0], [args[1]])
