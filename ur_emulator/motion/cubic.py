"""A cubic curve between two points with given derivatives: the shape of all blends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Vector = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Cubic:
    """p(u) = c0 + c1 u + c2 u^2 + c3 u^3 for u in 0..1, in any number of coordinates."""

    c0: Vector
    c1: Vector
    c2: Vector
    c3: Vector

    @classmethod
    def between(
        cls, start: Sequence[float], slope: Sequence[float], end: Sequence[float], end_slope: Sequence[float]
    ) -> Cubic:
        """Return the curve with these values and derivatives at u = 0 and u = 1 (Hermite's form)."""
        difference = [b - a for a, b in zip(start, end, strict=True)]
        return cls(
            tuple(start),
            tuple(slope),
            tuple(3.0 * w - 2.0 * a - b for w, a, b in zip(difference, slope, end_slope, strict=True)),
            tuple(a + b - 2.0 * w for w, a, b in zip(difference, slope, end_slope, strict=True)),
        )

    def at(self, u: float) -> tuple[Vector, Vector]:
        """Return the point and the derivative with respect to u."""
        rows = list(zip(self.c0, self.c1, self.c2, self.c3, strict=True))
        return (
            tuple(a + u * (b + u * (c + u * d)) for a, b, c, d in rows),
            tuple(b + u * (2.0 * c + u * 3.0 * d) for _, b, c, d in rows),
        )

    def fastest(self) -> Vector:
        """Return for each coordinate the greatest absolute value of the derivative."""
        found = []
        for b, c, d in zip(self.c1, self.c2, self.c3, strict=True):
            values = [b, b + 2.0 * c + 3.0 * d]
            if d != 0.0 and 0.0 < -c / (3.0 * d) < 1.0:
                values.append(b - c * c / (3.0 * d))
            found.append(max(map(abs, values)))
        return tuple(found)

    def bends(self) -> tuple[Vector, Vector]:
        """Return the second derivatives at both ends; in between it is a mixture of them."""
        return (
            tuple(2.0 * c for c in self.c2),
            tuple(2.0 * c + 6.0 * d for c, d in zip(self.c2, self.c3, strict=True)),
        )
