"""Vectors of 4 and 8 floats, raw memory and atomics for numba kernels.

Values are `<N x float>` of LLVM, known to numba as a type of its own; plain IR, so that every CPU that
LLVM knows gets its own instructions. Memory is given by address (uint64) and index in elements: that
costs no reference counting and keeps argument lists short.

Arithmetic on vectors is IEEE to the letter, whatever fast-math flags the kernel has: the edge test of
triangles needs a*b - c*d to be the exact negative of c*d - a*b, which a contracted one is not.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.extending import models, register_model

intrinsic: Any = extending.intrinsic
_F32, _I32, _I64 = ir.FloatType(), ir.IntType(32), ir.IntType(64)
# Numba adds a kernel's fast-math flags to instructions that have none; this one changes nothing on + - *.
_EXACT = ("arcp",)


class Vector(types.Type):
    """The numba type of a vector of floats."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        super().__init__(name=f"float32x{lanes}")


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Vector) -> None:
        super().__init__(manager, kind, _vector(kind.lanes))


def aligned(count: int, dtype: Any = np.float32, alignment: int = 64) -> np.ndarray:
    """Return `count` zeros of `dtype` that start at a multiple of `alignment` bytes."""
    size = count * np.dtype(dtype).itemsize
    raw = np.zeros(size + alignment, np.uint8)
    start = -raw.ctypes.data % alignment
    return raw[start : start + size].view(dtype)


def address(array: np.ndarray) -> np.uint64:
    """Return the uint64 address of the array's first element; the caller keeps the array alive."""
    return np.uint64(array.ctypes.data)


def _vector(lanes: int) -> ir.VectorType:
    return ir.VectorType(_F32, lanes)


@intrinsic
def data(typingctx, array):
    """The address, uint64, of the first element of an array that a kernel is given; see `address`."""

    def code(context, builder, signature, args):
        (value,) = args
        return builder.ptrtoint(context.make_array(array)(context, builder, value).data, _I64)

    return types.uintp(array), code


def _pointer(context: Any, builder: Any, base: Any, index: Any, kind: Any, element: Any, value: Any) -> Any:
    """A pointer to a `value` that begins at the element of that index, of numba's type `kind`, of those at
    the address `base`."""
    index = context.cast(builder, index, kind, types.int64 if kind.signed else types.uint64)
    start = builder.inttoptr(base, ir.PointerType(element))
    return builder.bitcast(builder.gep(start, [index], source_etype=element), ir.PointerType(value))


def _load(kind: Any, value: Any, element: Any, align: int) -> Any:
    @intrinsic
    def load(typingctx, base, index):
        def code(context, builder, signature, args):
            start, offset = args
            pointer = _pointer(context, builder, start, offset, index, element, value)
            return builder.load(pointer, align=align, typ=value)

        return kind(types.uintp, index), code

    return load


def _store(kind: Any, element: Any, align: int) -> Any:
    @intrinsic
    def store(typingctx, base, index, value):
        def code(context, builder, signature, args):
            start, offset, stored = args
            pointer = _pointer(context, builder, start, offset, index, element, stored.type)
            builder.store(stored, pointer, align=align)
            return context.get_dummy_value()

        return types.void(types.uintp, index, kind), code

    return store


_V4, _V8 = Vector(4), Vector(8)
# f: float32, u: uint32, q: uint64; (address, index in elements[, value])
ldf, stf = _load(types.float32, _F32, _F32, 4), _store(types.float32, _F32, 4)
ldu, stu = _load(types.uint32, _I32, _I32, 4), _store(types.uint32, _I32, 4)
ldq, stq = _load(types.uint64, _I64, _I64, 8), _store(types.uint64, _I64, 8)
# Vectors: (address, index in floats[, value]); at multiples of the vector's own size.
vload4, vstore4 = _load(_V4, _vector(4), _F32, 16), _store(_V4, _F32, 16)
vload8, vstore8 = _load(_V8, _vector(8), _F32, 32), _store(_V8, _F32, 32)


def _splat(lanes: int) -> Any:
    @intrinsic
    def splat(typingctx, x):
        def code(context, builder, signature, args):
            (number,) = args
            undefined = ir.Constant(_vector(lanes), ir.Undefined)
            one = builder.insert_element(undefined, number, ir.Constant(_I32, 0))
            zeros = ir.Constant(ir.VectorType(_I32, lanes), [0] * lanes)
            return builder.shuffle_vector(one, undefined, zeros)

        return Vector(lanes)(types.float32), code

    return splat


splat4, splat8 = _splat(4), _splat(8)


def _pairwise(emit: Callable[[Any, Any, Any], Any]) -> Any:
    @intrinsic
    def operation(typingctx, a, b):
        def code(context, builder, signature, args):
            return emit(builder, *args)

        return a(a, b), code

    return operation


vadd = _pairwise(lambda b, x, y: b.fadd(x, y, flags=_EXACT))
vsub = _pairwise(lambda b, x, y: b.fsub(x, y, flags=_EXACT))
vmul = _pairwise(lambda b, x, y: b.fmul(x, y, flags=_EXACT))
vdiv = _pairwise(lambda b, x, y: b.fdiv(x, y, flags=("nsz",)))
# Where an operand is NaN the second one wins, as in the instructions of x86.
vmin = _pairwise(lambda b, x, y: b.select(b.fcmp_ordered("<", x, y, flags=_EXACT), x, y))
vmax = _pairwise(lambda b, x, y: b.select(b.fcmp_ordered(">", x, y, flags=_EXACT), x, y))


@intrinsic
def vfma(typingctx, a, b, c):
    """Vectors of float32: a * b + c, rounded once where the CPU can."""

    def code(context, builder, signature, args):
        name, kind, module = f"llvm.fmuladd.v{a.lanes}f32", _vector(a.lanes), builder.module
        known = module.globals.get(name)
        return builder.call(known or ir.Function(module, ir.FunctionType(kind, [kind] * 3), name), args)

    return a(a, b, c), code


@intrinsic
def vsqrt(typingctx, a):
    """The square roots of a vector of float32."""

    def code(context, builder, signature, args):
        name, kind, module = f"llvm.sqrt.v{a.lanes}f32", _vector(a.lanes), builder.module
        known = module.globals.get(name)
        return builder.call(known or ir.Function(module, ir.FunctionType(kind, [kind]), name), args)

    return a(a), code


@intrinsic
def vget(typingctx, a, lane):
    """One lane of a vector, a float32."""

    def code(context, builder, signature, args):
        vector, index = args
        return builder.extract_element(vector, context.cast(builder, index, lane, types.uint32))

    return types.float32(a, lane), code


@intrinsic
def vsign(typingctx, a):
    """The sign bits of a vector alone: one of float32 +0 and -0."""

    def code(context, builder, signature, args):
        integers = ir.VectorType(_I32, a.lanes)
        mask = ir.Constant(integers, [0x80000000] * a.lanes)
        (vector,) = args
        return builder.bitcast(builder.and_(builder.bitcast(vector, integers), mask), _vector(a.lanes))

    return a(a), code


@intrinsic
def vxor(typingctx, a, b):
    """Bits of the float32 vectors a and b, exclusive or; with `vsign(b)`: a times the sign of b."""

    def code(context, builder, signature, args):
        integers = ir.VectorType(_I32, a.lanes)
        bits = [builder.bitcast(arg, integers) for arg in args]
        return builder.bitcast(builder.xor(*bits), _vector(a.lanes))

    return a(a, b), code


@intrinsic
def vkeep(typingctx, signs, a):
    """The lanes of a where those of `signs` are negative or -0, else 0; vectors of float32."""

    def code(context, builder, signature, args):
        integers = ir.VectorType(_I32, a.lanes)
        zero = ir.Constant(integers, [0] * a.lanes)
        tested, vector = args
        kept = builder.icmp_signed("<", builder.bitcast(tested, integers), zero)
        return builder.select(kept, vector, ir.Constant(_vector(a.lanes), [0.0] * a.lanes))

    return a(signs, a), code


@intrinsic
def vwhere(typingctx, a, b, yes, no):
    """The lanes of `yes` where a <= b, else those of `no`, also for NaN; vectors of float32."""

    def code(context, builder, signature, args):
        one, other, chosen, left = args
        return builder.select(builder.fcmp_ordered("<=", one, other, flags=_EXACT), chosen, left)

    return a(a, b, yes, no), code


def _mask(compare: str) -> Any:
    @intrinsic
    def mask(typingctx, a, b):
        def code(context, builder, signature, args):
            lanes = builder.fcmp_ordered(compare, *args, flags=_EXACT)
            return builder.zext(builder.bitcast(lanes, ir.IntType(a.lanes)), _I32)

        return types.uint32(a, b), code

    return mask


mask_le = _mask("<=")  # bit k: whether lane k of a <= that of b; false for NaN


@intrinsic
def mask_inside(typingctx, least, t, low, high):
    """Bit k, of uint32: whether least >= 0 and low < t <= high in lane k; false for NaN."""

    def code(context, builder, signature, args):
        weight, distance, above, up_to = args
        zero = ir.Constant(_vector(least.lanes), [0.0] * least.lanes)
        lanes = builder.fcmp_ordered(">=", weight, zero, flags=_EXACT)
        lanes = builder.and_(lanes, builder.fcmp_ordered(">", distance, above, flags=_EXACT))
        lanes = builder.and_(lanes, builder.fcmp_ordered("<=", distance, up_to, flags=_EXACT))
        return builder.zext(builder.bitcast(lanes, ir.IntType(least.lanes)), _I32)

    return types.uint32(least, t, low, high), code


@intrinsic
def count_trailing_zeros(typingctx, x):
    """Index of the lowest set bit of a uint32 that is not 0."""

    def code(context, builder, signature, args):
        return builder.cttz(*args, ir.Constant(ir.IntType(1), 1))

    return types.uint32(types.uint32), code


@intrinsic
def f2u(typingctx, x):
    """The bits of a float32."""

    def code(context, builder, signature, args):
        return builder.bitcast(*args, _I32)

    return types.uint32(types.float32), code


@intrinsic
def u2f(typingctx, x):
    """The float32 that has these bits."""

    def code(context, builder, signature, args):
        return builder.bitcast(*args, _F32)

    return types.float32(types.uint32), code


@intrinsic
def atomic_add(typingctx, base, value):
    """Add to the int64 at an address and return what was there before."""

    def code(context, builder, signature, args):
        at, added = args
        return builder.atomic_rmw("add", builder.inttoptr(at, ir.PointerType(_I64)), added, "monotonic")

    return types.int64(types.uintp, types.int64), code


@intrinsic
def alloca(typingctx, words):
    """Address of `words` (a constant) uint64 on the machine's stack, 64-byte aligned, kept until return."""
    if not isinstance(words, types.IntegerLiteral):
        return None

    def code(context, builder, signature, args):
        with builder.goto_entry_block():
            room = builder.alloca(ir.ArrayType(_I64, words.literal_value))
            room.align = 64
        return builder.ptrtoint(room, _I64)

    return types.uintp(words), code
