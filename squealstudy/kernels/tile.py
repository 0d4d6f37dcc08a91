"""Products of one tile of the observation matrix, with one design point or with eight at once.

A tile holds the rows of POINTS contact points mode by mode, (n, ROWS): N of all points, then T1,
then T2; n is a multiple of LANES. numba has no vector registers and LLVM does not find these
forms by itself, so the products are written as LLVM instructions: loops over modes, all sums in
vector registers. The numpy functions below say what they mean, and run where the compiler is
switched off.

For one design the lanes of a register are the points of a tile, and a tile is read as one stream.
For eight they are the designs: each entry is read once and multiplied with all of them, at the
rate of the processor's multiply-adds (studies/benchmarks/transient_kernels.py).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

ir = cgutils.ir

LANES = 8  # doubles in a register; LLVM splits them where the processor has shorter ones
POINTS = 8
ROWS = 3 * POINTS
UNROLL = 4  # modes at once in `observe_one`: its sums would wait for each other otherwise

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
ZERO = ir.Constant(VECTOR, [0.0] * LANES)
NOTHING = ir.Constant(VECTOR, ir.Undefined)

Generator = tuple[Any, Callable[..., Any]]


def observe_one(tile: np.ndarray, q: np.ndarray, v: np.ndarray, y: np.ndarray) -> None:
    """Y (ROWS,) = [N q; T1 v; T2 v] of a tile (n, ROWS), f8 or f4; all others f8, q, v (n,)."""
    y[:POINTS] = tile[:, :POINTS].T @ q
    y[POINTS:] = tile[:, POINTS:].T @ v


def spread_one(tile: np.ndarray, r: np.ndarray, F: np.ndarray) -> None:
    """F (n,) += tile r with the forces r (ROWS,)."""
    F += tile @ r


def observe_eight(tile: np.ndarray, q: np.ndarray, v: np.ndarray, y: np.ndarray) -> None:
    """Y (LANES, ROWS) = [N q; T1 v; T2 v] of the designs in the lanes of q, v (n, LANES)."""
    y[:, :POINTS] = q.T @ tile[:, :POINTS]
    y[:, POINTS:] = v.T @ tile[:, POINTS:]


def spread_eight(tile: np.ndarray, r: np.ndarray, F: np.ndarray) -> None:
    """F (n, LANES) += tile r^T with the forces r (LANES, ROWS)."""
    F += tile @ r.T


class _Writer:
    """Writes vector instructions for C-ordered arguments, f8 but for a tile that may be f4."""

    def __init__(self, context: Any, builder: Any, kinds: Sequence[Any], args: Sequence[Any]):
        self.builder = builder
        arrays = [
            context.make_array(k)(context, builder, a) for k, a in zip(kinds, args, strict=True)
        ]
        self.data = [a.data for a in arrays]
        self.n = cgutils.unpack_tuple(builder, arrays[0].shape)[0]
        product = ir.FunctionType(VECTOR, [VECTOR] * 3)
        name = f"llvm.fmuladd.v{LANES}f64"
        self.fmuladd = cgutils.get_or_insert_function(builder.module, product, name)

    @staticmethod
    def index(i: int) -> Any:
        return ir.Constant(ir.IntType(64), i)

    def at(self, i: Any, stride: int, offset: int = 0) -> Any:
        """Source of the index i stride + offset."""
        scaled = self.builder.mul(i, self.index(stride))
        return self.builder.add(scaled, self.index(offset))

    def vector(self, array: int, at: Any) -> Any:
        """Address of LANES entries of an argument from `at` on."""
        kind = ir.VectorType(self.data[array].type.pointee, LANES)
        return self.builder.bitcast(self.builder.gep(self.data[array], [at]), kind.as_pointer())

    def double(self, value: Any, kind: Any) -> Any:
        """A value of single precision in double precision."""
        return value if value.type == kind else self.builder.fpext(value, kind)

    def load(self, array: int, at: Any) -> Any:
        return self.double(self.builder.load(self.vector(array, at), align=4), VECTOR)

    def store(self, value: Any, array: int, at: Any) -> None:
        self.builder.store(value, self.vector(array, at), align=8)

    def broadcast(self, array: int, at: Any) -> Any:
        """One entry of an argument in all lanes."""
        stored = self.builder.load(self.builder.gep(self.data[array], [at]))
        entry = self.double(stored, ir.DoubleType())
        one = self.builder.insert_element(NOTHING, entry, ir.Constant(ir.IntType(32), 0))
        return self.shuffle(one, NOTHING, [0] * LANES)

    def shuffle(self, a: Any, b: Any, lanes: list[int]) -> Any:
        kind = ir.VectorType(ir.IntType(32), LANES)
        return self.builder.shuffle_vector(a, b, ir.Constant(kind, lanes))

    def add(self, *values: Any) -> Any:
        total = values[0]
        for value in values[1:]:
            total = self.builder.fadd(total, value)
        return total

    def add_product(self, total: Any, a: Any, b: Any) -> Any:
        return self.builder.call(self.fmuladd, [a, b, total])

    def sums(self, n: int) -> list[Any]:
        """Variables of a loop; LLVM keeps them in registers."""
        return [cgutils.alloca_once_value(self.builder, ZERO) for _ in range(n)]

    def accumulate(self, total: Any, a: Any, b: Any) -> None:
        self.builder.store(self.add_product(self.builder.load(total), a, b), total)

    def transposed(self, values: list[Any]) -> list[Any]:
        """LANES vectors transposed: blocks of 1, 2, 4 lanes change places."""
        values = list(values)
        for width in (1, 2, 4):
            a = [i if not i & width else i - width + LANES for i in range(LANES)]
            b = [i + width if not i & width else i + LANES for i in range(LANES)]
            for i in (i for i in range(LANES) if not i & width):
                one, two = values[i], values[i + width]
                values[i], values[i + width] = self.shuffle(one, two, a), self.shuffle(one, two, b)
        return values

    def transposed_sums(self, values: list[Any]) -> Any:
        """The sums over the lanes of LANES vectors, in the lanes of one."""
        width = 1
        while len(values) > 1:
            low = [_lane(i, width, 0) for i in range(LANES)]
            high = [_lane(i, width, width) for i in range(LANES)]
            values = [
                self.add(self.shuffle(a, b, low), self.shuffle(a, b, high))
                for a, b in zip(values[::2], values[1::2], strict=True)
            ]
            width *= 2
        return values[0]


def _lane(i: int, width: int, offset: int) -> int:
    """Where lane i of a halving step comes from: blocks alternate between its two vectors."""
    block, within = divmod(i, width)
    pair, second = divmod(block, 2)
    return pair * 2 * width + within + offset + second * LANES


def _write_observe_one(_typing: Any, tile: Any, q: Any, v: Any, y: Any) -> Generator:
    """Points in the lanes."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        w = _Writer(context, builder, signature.args, args)
        sums = w.sums(3 * UNROLL)
        with cgutils.for_range(builder, builder.udiv(w.n, w.index(UNROLL))) as loop:
            for u in range(UNROLL):
                j = w.at(loop.index, UNROLL, u)
                values = [w.broadcast(1, j), w.broadcast(2, j)]
                for c in range(3):
                    rows = w.load(0, w.at(j, ROWS, c * POINTS))
                    w.accumulate(sums[3 * u + c], rows, values[min(c, 1)])
        for c in range(3):
            w.store(w.add(*(builder.load(x) for x in sums[c::3])), 3, w.index(c * POINTS))
        return context.get_dummy_value()

    return types.void(tile, q, v, y), generate


def _write_spread_one(_typing: Any, tile: Any, r: Any, F: Any) -> Generator:
    """Points in the lanes of the products, LANES modes in those of their sum."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        w = _Writer(context, builder, signature.args, args)
        forces = [w.load(1, w.index(c * POINTS)) for c in range(3)]
        with cgutils.for_range(builder, builder.udiv(w.n, w.index(LANES))) as loop:
            products = []
            for u in range(LANES):
                total = ZERO
                for c in range(3):
                    rows = w.load(0, w.at(w.at(loop.index, LANES, u), ROWS, c * POINTS))
                    total = w.add_product(total, rows, forces[c])
                products.append(total)
            modes = w.at(loop.index, LANES)
            w.store(w.add(w.load(2, modes), w.transposed_sums(products)), 2, modes)
        return context.get_dummy_value()

    return types.void(tile, r, F), generate


def _write_observe_eight(_typing: Any, tile: Any, q: Any, v: Any, y: Any) -> Generator:
    """Designs in the lanes."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        w = _Writer(context, builder, signature.args, args)
        sums = w.sums(ROWS)
        with cgutils.for_range(builder, w.n) as loop:
            values = [w.load(a, w.at(loop.index, LANES)) for a in (1, 2)]
            for i in range(ROWS):
                entry = w.broadcast(0, w.at(loop.index, ROWS, i))
                w.accumulate(sums[i], entry, values[min(i // POINTS, 1)])
        for c in range(3):
            seen = [builder.load(x) for x in sums[c * POINTS : (c + 1) * POINTS]]
            for d, points in enumerate(w.transposed(seen)):
                w.store(points, 3, w.index(d * ROWS + c * POINTS))
        return context.get_dummy_value()

    return types.void(tile, q, v, y), generate


def _write_spread_eight(_typing: Any, tile: Any, r: Any, F: Any) -> Generator:
    """Designs in the lanes; three sums a mode, so that they wait less for each other."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        w = _Writer(context, builder, signature.args, args)
        forces = []
        for c in range(3):
            designs = [w.load(1, w.index(d * ROWS + c * POINTS)) for d in range(LANES)]
            forces += w.transposed(designs)
        with cgutils.for_range(builder, w.n) as loop:
            sums = [w.load(2, w.at(loop.index, LANES)), ZERO, ZERO]
            for i in range(ROWS):
                entry = w.broadcast(0, w.at(loop.index, ROWS, i))
                sums[i % 3] = w.add_product(sums[i % 3], entry, forces[i])
            w.store(w.add(*sums), 2, w.at(loop.index, LANES))
        return context.get_dummy_value()

    return types.void(tile, r, F), generate


if not numba.config.DISABLE_JIT:
    observe_one = intrinsic(_write_observe_one)
    spread_one = intrinsic(_write_spread_one)
    observe_eight = intrinsic(_write_observe_eight)
    spread_eight = intrinsic(_write_spread_eight)
