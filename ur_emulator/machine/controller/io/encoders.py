"""The two conveyor encoders: pulses on digital inputs, or counts that a program feeds.

Source: URScript manual CB3 3.15, encoder functions. Chosen: counts are not filtered; decoded pulses wrap at
65536 (the range that later manuals give); A before B counts up. A real box samples pulses at 40 kHz, this
one once a cycle.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

# Inputs that can take pulses: 0 to 3, which later manuals number 8 to 11.
PULSE_INPUTS = {pin: pin % 8 for pin in (0, 1, 2, 3, 8, 9, 10, 11)}
# Lowest count and number of counts by range code.
RANGES = {
    0: (-(1 << 31), 1 << 32),
    1: (0, 1 << 8),
    2: (0, 1 << 16),
    3: (0, 1 << 24),
    4: (0, 1 << 32),
}
PULSE_RANGE = 2


class Decoder(IntEnum):
    """How pulses are counted."""

    OFF = 0
    QUADRATURE = 1
    EDGES = 2
    RISING = 3
    FALLING = 4


# Steps from (A, B) before to (A, B) now; two changes at once are ambiguous and count nothing.
_CYCLE = ((False, False), (True, False), (True, True), (False, True))
_QUADRATURE = {(a, _CYCLE[(i + step) % 4]): step for i, a in enumerate(_CYCLE) for step in (1, -1)}


@dataclass(slots=True)
class Encoder:
    """One encoder.

    Attributes:
        is_fed: a program sets its count.
        count: present one [ticks], within the range `range_id` of RANGES.
        travel: sum of all ticks, without wraps; it continues when the encoder is set up again.
    """

    decoder: Decoder = Decoder.OFF
    is_fed: bool = False
    count: float = 0.0
    range_id: int = PULSE_RANGE
    travel: float = 0.0
    _pins: tuple[int, int] = (0, 1)
    _last: tuple[bool, bool] = (False, False)

    @property
    def is_enabled(self) -> bool:
        """True while it counts or is fed."""
        return self.is_fed or self.decoder is not Decoder.OFF

    def decode(self, decoder: Decoder, pin_a: int, pin_b: int, digital_in: int) -> None:
        """Count pulses on two inputs from zero, or stop counting."""
        self.decoder, self.is_fed = decoder, False
        self.count, self.range_id = 0.0, PULSE_RANGE
        self._pins = (pin_a, pin_b)
        self._last = self._read(digital_in)

    def feed(self, range_id: int) -> None:
        """Let the program set the count."""
        self.decoder, self.is_fed, self.range_id = Decoder.OFF, True, range_id
        self.count = 0.0

    def set_count(self, count: float) -> None:
        """Set the count from a program; the smaller of the two differences is taken."""
        self.travel += self.unwind(count - self.count)
        self.count = count

    def step(self, digital_in: int) -> None:
        """Read the inputs once."""
        now, before = self._read(digital_in), self._last
        self._last = now
        match self.decoder:
            case Decoder.QUADRATURE:
                step = _QUADRATURE.get((before, now), 0)
            case Decoder.EDGES:
                step = now[0] != before[0]
            case Decoder.RISING:
                step = now[0] and not before[0]
            case _:
                step = before[0] and not now[0]
        self.travel += step
        self.count = (self.count + step) % RANGES[self.range_id][1]

    def unwind(self, delta: float) -> float:
        """Return a difference of counts without the wrap at the end of the range."""
        size = RANGES[self.range_id][1]
        return delta - math.copysign(size, delta) if abs(delta) > size / 2 else delta

    def _read(self, digital_in: int) -> tuple[bool, bool]:
        a, b = self._pins
        return bool(digital_in >> a & 1), bool(digital_in >> b & 1)
