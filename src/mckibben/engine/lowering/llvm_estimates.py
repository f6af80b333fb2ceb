"""Mode ``fast`` on processors with AVX-512: reciprocals and roots from the processor's estimates of 14 bits.

Newton's iteration doubles the bits: twice in float64, once in float32. Errors are one or two units in the last place. Given
up: the reciprocal of 0 or of an infinity, and the root of an infinity, are NaN; roots of numbers below 1e-290 (1e-30 in
float32) are wrong by up to that root.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .llvm_text import Memory


def fits(width: int, real: str, bits: int) -> bool:
    """Whether vectors of a width are made of whole registers with estimates."""
    return bits == 512 and width & (width - 1) == 0 and width >= (8 if real == "double" else 16)


def reciprocal(body: Memory, d: str) -> str:
    """1/d."""
    kind = body.type("real", True)
    y, minus = _estimate(body, "rcp14", d), body.emit(f"fneg {kind} {d}")
    for _ in range(2 if body.real == "double" else 1):
        off = _fma(body, minus, y, _all(body, 1.0))
        y = _fma(body, y, off, y)
    return y


def root(body: Memory, x: str) -> str:
    """The square root, by Goldschmidt's form of the iteration; of what is below 0, NaN."""
    kind, truth = body.type("real", True), body.type("bool", True)
    tiny = _all(body, 1e-290 if body.real == "double" else 1e-30)
    small = body.emit(f"fcmp olt {kind} {x}, {tiny}")
    y = _estimate(body, "rsqrt14", body.emit(f"select {truth} {small}, {kind} {tiny}, {kind} {x}"))
    g, h = body.emit(f"fmul {kind} {x}, {y}"), body.emit(f"fmul {kind} {_all(body, 0.5)}, {y}")
    for _ in range(2 if body.real == "double" else 1):
        off = _fma(body, body.emit(f"fneg {kind} {h}"), g, _all(body, 0.5))
        g, h = _fma(body, g, off, g), _fma(body, h, off, h)
    below = body.emit(f"fcmp olt {kind} {x}, zeroinitializer")
    return body.emit(f"select {truth} {below}, {kind} {_all(body, float('nan'))}, {kind} {g}")


def _all(body: Memory, value: float) -> str:
    from .llvm_text import number

    return f"splat ({body.real} {number(value, body.real)})"


def _fma(body: Memory, a: str, b: str, c: str) -> str:
    kind = body.type("real", True)
    name = f"llvm.fma.v{body.width}{'f64' if body.real == 'double' else 'f32'}"
    return body.intrinsic(name, kind, (kind, a), (kind, b), (kind, c))


def _estimate(body: Memory, what: str, x: str) -> str:
    """The processor's estimate, register by register."""
    lanes, short = (8, "pd") if body.real == "double" else (16, "ps")
    whole, part = body.type("real", True), f"<{lanes} x {body.real}>"
    found = []
    for k in range(body.width // lanes):
        piece = x
        if body.width > lanes:
            mask = ", ".join(f"i32 {k * lanes + i}" for i in range(lanes))
            piece = body.emit(f"shufflevector {whole} {x}, {whole} poison, <{lanes} x i32> <{mask}>")
        name = f"llvm.x86.avx512.{what}.{short}.512"
        mask_type = f"i{lanes}"
        found.append(body.intrinsic(name, part, (part, piece), (part, "zeroinitializer"), (mask_type, "-1")))
    size = lanes
    while len(found) > 1:
        size *= 2
        mask = ", ".join(f"i32 {i}" for i in range(size))
        half = f"<{size // 2} x {body.real}>"
        found = [
            body.emit(f"shufflevector {half} {a}, {half} {b}, <{size} x i32> <{mask}>")
            for a, b in zip(found[::2], found[1::2], strict=True)
        ]
    return found[0]
