"""Compilation by numba where it is installed; without it everything runs as plain Python, only slower."""

from typing import Any, TypeVar

from dcdrw_sim import strikes, taylor

Function = TypeVar('Function')

try:
    from llvmlite import ir
    from numba import njit, types
    from numba.core import cgutils
    from numba.extending import intrinsic, overload, register_jitable
    AVAILABLE = True
except ImportError:
    AVAILABLE = False

# Contraction to fused multiply-add is the only liberty taken: every lane gets the same result as every other.
_OPTIONS: dict[str, Any] = {'error_model': 'numpy', 'fastmath': {'contract'}, 'cache': True}


def compiled(function: Function) -> Function:
    """The function compiled to machine code, or itself where numba is missing."""
    return njit(**_OPTIONS)(function) if AVAILABLE else function


if AVAILABLE:
    # The two inner loops, with their sums held in vector registers: LLVM does not find that by itself.
    _INTEGER, _VECTOR = ir.IntType(64), ir.VectorType(ir.DoubleType(), taylor.LANES)

    def _row(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        """A function from an offset in the work array to the pointer to a vector of all lanes."""
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return lambda offset: builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer())

    def _multiply_add(builder, x, y, z):  # type: ignore[no-untyped-def]
        return builder.fadd(builder.fmul(x, y, flags=('contract',)), z, flags=('contract',))

    def _at(builder, base, index):  # type: ignore[no-untyped-def]
        return builder.add(base, builder.mul(index, _INTEGER(taylor.LANES)))

    @intrinsic  # type: ignore[untyped-decorator]
    def _convolve_lanes(typing_context, w, out, a, b, n):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            row, (_, out, a, b, n) = _row(context, builder, signature, arguments), arguments
            total = cgutils.alloca_once(builder, _VECTOR)
            builder.store(ir.Constant(_VECTOR, [0.0] * taylor.LANES), total)
            with cgutils.for_range(builder, builder.add(n, _INTEGER(1))) as loop:
                x = builder.load(row(_at(builder, a, loop.index)), align=8)
                y = builder.load(row(_at(builder, b, builder.sub(n, loop.index))), align=8)
                builder.store(_multiply_add(builder, x, y, builder.load(total)), total)
            builder.store(builder.load(total), row(out), align=8)
            return context.get_dummy_value()
        return types.void(w, *4 * [types.intp]), generate

    @intrinsic  # type: ignore[untyped-decorator]
    def _evaluate_lanes(typing_context, w, out, series, times):  # type: ignore[no-untyped-def]
        def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            row, (_, out, series, times) = _row(context, builder, signature, arguments), arguments
            t = builder.load(row(times), align=8)
            total = ir.Constant(_VECTOR, [0.0] * taylor.LANES)
            for j in range(taylor.ORDER, -1, -1):
                total = _multiply_add(builder, total, t, builder.load(row(_at(builder, series, _INTEGER(j))), align=8))
            builder.store(total, row(out), align=8)
            return context.get_dummy_value()
        return types.void(w, *3 * [types.intp]), generate

    @overload(taylor.convolve)  # type: ignore[untyped-decorator]
    def _convolve(w, out, a, b, n, lanes):  # type: ignore[no-untyped-def]
        return lambda w, out, a, b, n, lanes: _convolve_lanes(w, out, a, b, n)

    @overload(taylor.evaluate_lanes)  # type: ignore[untyped-decorator]
    def _evaluate(w, out, series, times, lanes):  # type: ignore[no-untyped-def]
        return lambda w, out, series, times, lanes: _evaluate_lanes(w, out, series, times)

    for _function in (taylor.sin_series, taylor.cos_series, taylor.step_size, taylor.evaluate, strikes.reset,
                      strikes.crossing, strikes.first_strike):
        register_jitable(**_OPTIONS)(_function)
    # Inlined, so that the number of lanes is a constant in its loops.
    register_jitable(inline='always', **_OPTIONS)(taylor.expand)
