"""Time on the path: a pause slows it down to a standstill, and the first motion of a program runs it up.

An arm that has stopped on its path continues exactly there. An arm that has left its path, in a fast stop or
moved by hand, first returns to where it left it: slowly, all joints together (chosen; a real box leaves that
to the operator). Streams are not scaled: they ramp to rest and up again by themselves.
"""

# Rate of the time scaling in a pause and after it [1/s]. Chosen: as for the speed slider.
PAUSE_RATE = 4.0


class PathTime:
    """The rate of time on the path: a factor that ramps to 0 while `paused`, else to 1.

    The target of a cycle is where the factor at its beginning leads; its speed is that of the factor at its
    end. Source: recordings of the first move of a program; there the first cycle already advances by a step
    of the ramp (`runs_up`).

    Attributes:
        slowing, rising: rates of change of the factor [1/s].
    """

    def __init__(self) -> None:
        self.paused = self.runs_up = False
        self.factor = 1.0
        self.slowing = self.rising = PAUSE_RATE

    def resume(self) -> None:
        """End a pause; the factor rises from where it is."""
        self.paused = self.runs_up = False
        self.rising = PAUSE_RATE

    def begin(self, rate: float, *, runs_up: bool = False) -> None:
        """Rise from a standstill."""
        self.factor, self.rising, self.runs_up = 0.0, rate, runs_up

    def step(self, dt: float) -> float:
        """Advance the ramp by a cycle; return the factor at its beginning."""
        begin = self.factor
        if self.paused:
            self.factor = max(0.0, begin - self.slowing * dt)
        elif begin < 1.0:
            rise = self.rising * dt
            if self.runs_up and begin == 0.0:
                begin = rise
            self.factor = begin + rise if begin + rise < 1.0 - 1e-9 else 1.0
        return begin
