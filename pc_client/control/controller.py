"""`Controller`: every number that shapes the loop; the named controllers, and those of a user's file.

No number here may depend on the movement; a controller is chosen once for a whole experiment. A file:

    base = "paper"       # what the file starts from; preview by default
    gain_p = 10.0        # 1/s
    gain_i = 5.0         # 1/s2

Every other key is a field of `Controller`, whose type says what it may hold.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from pc_client.errors import ControllerError
from pc_client.files import FILE_KINDS
from ur_hil.records import Flag, checked, fields_of, nearest, number, record, word

DEFAULT = "preview"
"""The controller when none is named."""

Value = float | bool


@record
class Controller:
    """One velocity controller: qd_cmd = feed-forward + gain_p * e + gain_i * integral of e, limited.

    Attributes:
        name: what `--controller` calls it, or what the numbers started from.
        gain_p: proportional gain [1/s].
        gain_i: integral gain [1/s2].
        uses_preview: True: the feed-forward is the mean reference velocity over the cycle in which the
            command will show in the reported position, i.e. shifted by the identified loop delay.
            False: the reference velocity at the current time.
        speedj_acceleration: the `a` of `speedj` in the robot's program [rad/s2], of the leading axis.
        slew_limit: largest change of a commanded joint velocity [rad/s2].
        integral_limit: largest correction by the integral part [rad/s].
        speed_share: share of the joint speed limits that a command may use, 0..1.
        path_tolerance: largest distance of the tool from its path that is allowed [m]; the guard of a run
            allows what the loop predicts and a margin (`experiment.prediction`), never more than this.
        angle_tolerance: the same for the angle of the tool to its orientation on the path [rad].
        compensates_lag: with `uses_preview`: dead time and lag are identified apart; the feed-forward is
            ahead by the dead time and adds lag * joint acceleration.
        compensates_gear: with `uses_preview`: the waves of the gears are found from the movements run so far,
            and the feed-forward is that of motors which make up for them (`gear`).
        uses_ilc: a repetition begins with what the run before it taught (`learning`).
        learning_gain: share of a run's error that is learned, 0..1.
        learning_speed: bound of the learned part of a command [rad/s].
        learning_acceleration: bound of its change [rad/s2].
    """

    name: str
    # The ranges refuse slips of the pen (a factor of a thousand, a wrong sign); whether gains suit a loop
    # depends on the identified one. Gains: 200 1/s is unstable with a dead time of one cycle.
    gain_p: Annotated[float, number(0.0, 200.0, "1/s")]
    gain_i: Annotated[float, number(0.0, 2000.0, "1/s2")]
    uses_preview: Flag
    speedj_acceleration: Annotated[float, number(0.1, 100.0, "rad/s2")]
    slew_limit: Annotated[float, number(0.1, 200.0, "rad/s2")]
    integral_limit: Annotated[float, number(0.0, 3.0, "rad/s")]
    speed_share: Annotated[float, number(0.1, 1.0)]
    path_tolerance: Annotated[float, number(0.0005, 0.1, "m")]
    angle_tolerance: Annotated[float, number(0.005, 0.5, "rad")] = 0.035
    compensates_lag: Flag = False
    compensates_gear: Flag = False
    uses_ilc: Flag = False
    learning_gain: Annotated[float, number(0.0, 1.0)] = 0.8
    learning_speed: Annotated[float, number(0.0, 1.0, "rad/s")] = 0.2
    learning_acceleration: Annotated[float, number(0.0, 200.0, "rad/s2")] = 20.0

    @staticmethod
    def paper(**numbers: Value) -> Controller:
        """The paper's controller: PI and feed-forward of the current time; its gains are ours.

        The paper gives none: they were chosen so that the SNR is near its Table I (docs/fidelity.md).

        Args:
            numbers: fields with other values, such as `gain_p=4.0`.

        Raises:
            ControllerError: there is no such field, or it cannot hold the value.
        """
        return _PAPER.changed(numbers)

    @staticmethod
    def preview(**numbers: Value) -> Controller:
        """Feed-forward ahead by the identified delay; arguments and errors as `paper`."""
        return _PREVIEW.changed(numbers)

    @staticmethod
    def best(**numbers: Value) -> Controller:
        """All that the identified loop allows, learning included; arguments and errors as `paper`."""
        return _BEST.changed(numbers)

    @staticmethod
    def from_toml(path: Path | str) -> Controller:
        """The controller of a file.

        Raises:
            ControllerError: the file cannot be read, a field does not exist or cannot hold its value.
        """
        values = FILE_KINDS["controller"].read_toml(Path(path))
        base = checked(_BASE, values.pop("base", DEFAULT), f"{path}: base", ControllerError)
        return CONTROLLERS[base].changed(values, lambda name: f"{path}: {name}")

    def changed(self, values: Mapping[str, object], where: Callable[[str], str] = str) -> Controller:
        """This controller with other values in some fields.

        Args:
            where: file and key, or option, that gave a field its value, for messages.

        Raises:
            ControllerError: there is no such field, or it cannot hold its value.
        """
        for name in values:
            if name not in FIELDS:
                raise ControllerError(f"{where(name)}: no such key; {nearest(name, FIELDS)}")
        kept = {k: checked(FIELDS[k], value, where(k), ControllerError) for k, value in values.items()}
        return replace(self, **kept)

    @property
    def title(self) -> str:
        """The name, and all in which this differs from the controller of that name.

        Two controllers with the same title have the same numbers: no table puts different ones together.
        """
        own = asdict(self)
        named = asdict(CONTROLLERS.get(self.name, self))
        changes = [f"{field} {_short(own[field])}" for field in own if own[field] != named[field]]
        return f"{self.name} with {', '.join(changes)}" if changes else self.name


FIELDS = fields_of(Controller)
"""What each field of a controller but its name may hold: for options, files and sweeps alike."""

# As published (Fig. 3): PI and feed-forward of the current time. The paper gives no numbers: these are
# ordinary ones, chosen once on the movements of the set `arcs` so that the mean SNR lay near the paper's. The
# agreement is a calibration, not a prediction (docs/fidelity.md, "What the numbers of the demo prove"). They
# are a tenth of the bound pi/2T of a 30-45 ms loop, gain_i = gain_p^2 / 8 so that the integral does not
# overshoot, and one acceleration for all joints, between movej's default of 1.4 and the 5 that users raise it
# to. It cuts corners, and a movement of .15 m in 1.5 s, which needs more acceleration, by up to 65 mm: hence
# the wider tolerances; beyond the room of the clearances the predicted way is checked, too.
_PAPER = Controller(
    name="paper",
    gain_p=4.0,
    gain_i=2.0,
    uses_preview=False,
    speedj_acceleration=3.0,
    slew_limit=15.0,
    integral_limit=0.1,
    speed_share=0.95,
    path_tolerance=0.08,
    angle_tolerance=0.07,
)

# Feed-forward ahead by the identified delay; the robot's own ramp is made short (UR's client library
# streams with a = 40), so that the delay is the only thing between command and motion.
_PREVIEW = Controller(
    name="preview",
    gain_p=5.0,
    gain_i=3.0,
    uses_preview=True,
    speedj_acceleration=40.0,
    slew_limit=30.0,
    integral_limit=0.1,
    speed_share=0.95,
    path_tolerance=0.005,
)

# All that the identified loop allows: its lag made up for as well, the waves of the gears once a movement has
# shown them, and each repetition of a movement uses ILC. The feedback is that of `preview`:
# it has little left to do.
_BEST = replace(_PREVIEW, name="best", compensates_lag=True, compensates_gear=True, uses_ilc=True)

# For the approach to a start, before anything is known of the loop: feedback that is stable with a delay of
# up to 300 ms (pi/2T), and slow. It overshoots the end of the approach in proportion to the delay (3 mm with
# 45 ms, 9 mm with 100 ms): its tolerances leave room for that. Not for movements, so it has no place in the
# table.
APPROACH = Controller(
    name="approach",
    gain_p=5.0,
    gain_i=0.0,
    uses_preview=False,
    speedj_acceleration=5.0,
    slew_limit=5.0,
    integral_limit=0.0,
    speed_share=0.3,
    path_tolerance=0.015,
    angle_tolerance=0.07,
)

CONTROLLERS = MappingProxyType({config.name: config for config in (_PAPER, _PREVIEW, _BEST)})
_BASE = word(CONTROLLERS)


def controller_of_law(name: str) -> Controller:
    """The numbers beside a law of a user: those of `preview` without feedback; the law may trail more."""
    return replace(_PREVIEW, name=f"own law {name}", gain_p=0.0, gain_i=0.0, path_tolerance=0.01)


def load_controller(name_or_file: str) -> Controller:
    """A named controller, or the one of a file whose name ends in .toml.

    Raises:
        ControllerError: no such controller, an unreadable file, or content that makes no sense.
    """
    if name_or_file.endswith(".toml"):
        return Controller.from_toml(name_or_file)
    if name_or_file not in CONTROLLERS:
        raise ControllerError(
            f"no controller is called {name_or_file!r}; choose one of {', '.join(CONTROLLERS)}, "
            "or give a file FILE.toml"
        )
    return CONTROLLERS[name_or_file]


def _short(value: object) -> str:
    """A value to the last digit, but 4 for 4.0 and true for True."""
    return str(value).lower() if isinstance(value, bool) else str(value).removesuffix(".0")
