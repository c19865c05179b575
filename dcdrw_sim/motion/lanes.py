"""Rows of the work array as LLVM vectors: numba finds neither the vectors nor the sums in registers by itself.

Imported only where numba is installed; it then gives functions of `dcdrw_sim.motion.taylor` their compiled form.
"""

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, overload, register_model

from dcdrw_sim.motion import taylor

_INTEGER = ir.IntType(64)
_VECTOR = ir.VectorType(ir.DoubleType(), taylor.LANES)
_ZERO = ir.Constant(_VECTOR, [0.0] * taylor.LANES)
_CONTRACT = ('contract',)


class _Kind(types.Type):
    """A numba type that is one LLVM value."""


ROW, ROWS, WORK = _Kind('Row'), _Kind('Rows'), _Kind('Work')


@register_model(_Kind)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR if kind == ROW else ir.DoubleType().as_pointer())


def _vector(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    """A row, or a number in every lane."""
    if kind == ROW:
        return value
    number = context.cast(builder, value, kind, types.float64)
    first = builder.insert_element(_ZERO, number, ir.IntType(32)(0))
    return builder.shuffle_vector(first, _ZERO, ir.Constant(ir.VectorType(ir.IntType(32), taylor.LANES), 0))


def _pointer(builder: Any, data: Any, offset: Any) -> Any:
    return builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())


def _function(name: str) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vectors = [_vector(context, builder, *pair) for pair in zip(arguments, signature.args, strict=True)]
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * len(vectors)), f'llvm.{name}.v{taylor.LANES}f64'
        )
        return builder.call(function, vectors)

    return generate


def _instruction(name: str) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vectors = [_vector(context, builder, *pair) for pair in zip(arguments, signature.args, strict=True)]
        return getattr(builder, name)(*vectors, flags=_CONTRACT)

    return generate


def _unary(function: Any, generate: Any) -> None:
    """Give a function of one row its code."""

    @intrinsic  # type: ignore[untyped-decorator]
    def apply(context: Any, x: Any) -> Any:
        return ROW(x), generate

    overload(function)(lambda x: (lambda x: apply(x)) if x == ROW else None)


def _binary(function: Any, generate: Any) -> None:
    """Give a function of two rows, or of a row and a number, its code."""

    @intrinsic  # type: ignore[untyped-decorator]
    def apply(context: Any, x: Any, y: Any) -> Any:
        return ROW(x, y), generate

    overload(function)(lambda x, y: (lambda x, y: apply(x, y)) if ROW in (x, y) else None)


for _name in ('add', 'sub', 'mul'):
    _binary(getattr(operator, _name), _instruction(f'f{_name}'))
_binary(operator.truediv, _instruction('fdiv'))
_unary(operator.neg, _instruction('fneg'))
_unary(abs, _function('fabs'))
_unary(taylor.sqrt, _function('sqrt'))
_binary(taylor.minimum, _function('minnum'))


@intrinsic  # type: ignore[untyped-decorator]
def _bare(context: Any, w: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(w)(context, builder, arguments[0]).data

    return WORK(w), generate


@intrinsic  # type: ignore[untyped-decorator]
def _rows(context: Any, w: Any) -> Any:
    return ROWS(w), lambda context, builder, signature, arguments: arguments[0]


@intrinsic  # type: ignore[untyped-decorator]
def _load(context: Any, data: Any, offset: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if data == WORK:
            return builder.load(builder.gep(arguments[0], [arguments[1]]))
        return builder.load(_pointer(builder, *arguments), align=8)

    return (ROW if data == ROWS else types.float64)(data, types.intp), generate


@intrinsic  # type: ignore[untyped-decorator]
def _store(context: Any, data: Any, offset: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if data == WORK:
            number = context.cast(builder, arguments[2], value, types.float64)
            builder.store(number, builder.gep(arguments[0], [arguments[1]]))
        else:
            vector = _vector(context, builder, arguments[2], value)
            builder.store(vector, _pointer(builder, *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(data, types.intp, value), generate


@intrinsic  # type: ignore[untyped-decorator]
def _convolve(context: Any, rows: Any, products: Any, n: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data, products, n = arguments
        jobs = [cgutils.unpack_tuple(builder, product) for product in cgutils.unpack_tuple(builder, products)]
        sums = [cgutils.alloca_once_value(builder, _ZERO) for _ in jobs]

        def load(series: Any, j: Any) -> Any:
            offset = builder.add(series, builder.mul(j, _INTEGER(taylor.LANES)))
            return builder.load(_pointer(builder, data, offset), align=8)

        with cgutils.for_range(builder, builder.add(n, _INTEGER(1))) as loop:
            for total, (_, a, b) in zip(sums, jobs, strict=True):
                product = builder.fmul(load(a, loop.index), load(b, builder.sub(n, loop.index)), flags=_CONTRACT)
                builder.store(builder.fadd(builder.load(total), product, flags=_CONTRACT), total)
        for total, (out, _, _) in zip(sums, jobs, strict=True):
            builder.store(builder.load(total), _pointer(builder, data, out), align=8)
        return context.get_dummy_value()

    return types.void(rows, products, types.intp), generate


# Lambdas, because numba would compare annotations.
overload(taylor.bare)(lambda w: lambda w: _bare(w))
overload(taylor.rows)(lambda w, lanes: lambda w, lanes: _rows(w))
overload(operator.getitem)(lambda a, b: (lambda a, b: _load(a, b)) if a in (ROWS, WORK) else None)
overload(operator.setitem)(lambda a, b, c: (lambda a, b, c: _store(a, b, c)) if a in (ROWS, WORK) else None)
overload(taylor.convolve)(lambda w, products, n: lambda w, products, n: _convolve(w, products, n))
