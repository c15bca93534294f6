"""The named controllers: every number that shapes the loop, in one table.

No number here may depend on the movement; a controller is chosen once for a whole experiment.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from pc_client.errors import ClientError


@dataclass(frozen=True, slots=True)
class ControllerConfig:
    """One velocity controller: qd_cmd = feed-forward + gain_p * e + gain_i * integral of e, limited.

    Attributes:
        name: what `--controller` calls it.
        gain_p: proportional gain [1/s].
        gain_i: integral gain [1/s2].
        looks_ahead: True: the feed-forward is the mean reference velocity over the cycle in which the
            command will show in the reported position, i.e. shifted by the identified loop delay.
            False: the reference velocity at the current time.
        speedj_acceleration: the `a` of `speedj` in the robot's program [rad/s2], of the leading axis.
        slew_limit: largest change of a commanded joint velocity [rad/s2].
        integral_limit: largest correction by the integral part [rad/s].
        speed_share: share of the joint speed limits that a command may use, 0..1.
        abort_error: position error of any joint that ends the run [rad].
    """

    name: str
    gain_p: float
    gain_i: float
    looks_ahead: bool
    speedj_acceleration: float
    slew_limit: float
    integral_limit: float
    speed_share: float
    abort_error: float


CONTROLLERS = MappingProxyType(
    {
        # As published (Fig. 3): PI and feed-forward of the current time. The paper gives no numbers. Gains as
        # a cautious user sets them: a tenth of the bound pi/2T of a 30-45 ms loop, gain_i = gain_p^2 / 8 so
        # that the integral does not overshoot. One acceleration for all joints and movements, between movej's
        # default of 1.4 that UR's manual shows in its speedj examples and the 5 that users raise it to.
        "paper": ControllerConfig(
            name="paper",
            gain_p=4.0,
            gain_i=2.0,
            looks_ahead=False,
            speedj_acceleration=3.0,
            slew_limit=15.0,
            integral_limit=0.1,
            speed_share=0.95,
            abort_error=0.2,
        ),
        # Feed-forward ahead by the identified delay; the robot's own ramp is made short (UR's client library
        # streams with a = 40), so that the delay is the only thing between command and motion.
        "preview": ControllerConfig(
            name="preview",
            gain_p=5.0,
            gain_i=3.0,
            looks_ahead=True,
            speedj_acceleration=40.0,
            slew_limit=30.0,
            integral_limit=0.1,
            speed_share=0.95,
            abort_error=0.2,
        ),
    }
)


def controller_config(name: str) -> ControllerConfig:
    """Return the controller called `name`.

    Raises:
        ClientError: no such controller.
    """
    config = CONTROLLERS.get(name)
    if config is None:
        raise ClientError(f"no controller is called {name!r}; choose one of {', '.join(CONTROLLERS)}")
    return config
