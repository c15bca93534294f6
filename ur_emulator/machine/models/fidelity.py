"""Fidelity: how far the emulated arm is from a perfect one, as one frozen set of numbers.

Four sets have names. `exact` has no physics: what is measured is the target, as in the maker's simulator.
`ideal` is for debugging clients: hardly a delay, hardly any noise. `typical` is what
logs and reports of real arms show, and the default. `poor` is an arm and a network at the bad end of what
users report. A file names one of them and says what is otherwise (`read_fidelity`). Every imperfection is
here; every number of the arm itself is in `RobotModel`.

Sources, cited by letter below:
 A  Logs of a real UR3e at rest and moving, 500 Hz (kevinhpham/DalESelfEBot): encoder noise, steps, the filter
    of the reported speed, speed ripple at 101 and 202 cycles a joint turn, current noise. UR's strain wave
    gears have the ratio 101 in all sizes, so that is once and twice a motor turn.
 B  Delays reported for streamed motion, from command to measurement: Universal_Robots_ROS_Driver pull 1 (aim
    of two cycles for speedj), Universal_Robots_ROS2_Driver issue 1311 (UR5 CB3 about 35 ms),
    ur_modern_driver (a gain of 50 1/s is stable on a UR3, so the whole loop stays below 31 ms there).
 C  Factory calibrations of 35 real arms, see `calibration.py`.
 E  assumed: no published figure; to be checked on a real arm.
 F  Record files of a real UR3 (CB3) at rest and moving, 125 Hz (mkrssg/UniversalRobots), measured by us.
 G  Free-drive demonstrations with a real UR5e, public h5 files, measured by us.
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from math import pi
from pathlib import Path
from typing import Annotated
from zlib import crc32

import numpy as np

from ur_emulator.errors import ModelError
from ur_hil.arithmetic import add_up
from ur_hil.input_files import MIB, FileKind
from ur_hil.records import Items, checked, nearest, number, record, whole, word


def random_stream(seed: int, name: str) -> np.random.Generator:
    """Return the generator named `name` of the box with this `seed` (any integer >= 0)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, crc32(name.encode())])))


_FILE = FileKind(MIB, ModelError, "all fields have less than 0.01 MiB")
# Of all waves of a gear together: beyond it the joint might turn back while its motor goes on.
_LARGEST_SLOPE = 0.5
# Friction changes its sign over about this in the controller's model, fully by .01 to .015 [rad/s]. Source:
# logs of a real UR3 (CB3), UR3e and UR10e, target current against target speed (O).
REVERSAL_SPEED = 0.006

Share = Annotated[float, number(0.0, 1.0)]
Angle = Annotated[float, number(0.0, 0.1, "rad")]
Time = Annotated[float, number(0.0, 0.2, "s")]
Noise = Annotated[float, number(0.0, 1000.0)]
SixAngles = tuple[Angle, Angle, Angle, Angle, Angle, Angle]
SixNoises = tuple[Noise, Noise, Noise, Noise, Noise, Noise]
Step = Annotated[float, number(1e-9, 1.0, "A")]
Pole = Annotated[float, number(0.1, 10_000.0, "Hz")]


@record
class Ripple:
    """One wave of the gears' transmission error.

    Attributes:
        cycles: of the wave in one turn of the joint [1].
        rms: speed ripple, as a share of the joint's speed [1].
        phase: of the wave at joint angle 0 [rad]; None: of each joint by the seed.
        joints: which joints have it, 0 is the base.
    """

    cycles: Annotated[float, number(1.0, 2000.0)]
    rms: Annotated[float, number(0.0, 0.2)]
    phase: Annotated[float, number(-10.0, 10.0, "rad")] | None = None
    joints: Annotated[tuple[Annotated[int, whole(0, 5)], ...], Items(1, 6)] = (0, 1, 2, 3, 4, 5)


@record
class Fidelity:
    """One set of imperfections.

    The loop delay that a streaming client sees is dead time + drive lag + feedback age + half a cycle of
    hold.

    Attributes:
        name: as on the command line.
        dead_time: from a streamed command to the target that it moves [s], rounded to whole control cycles.
        dead_time_wander: the dead time becomes longer by up to this and shorter again, along a cosine [s].
        dead_time_period: of that cosine [s]; where it begins is drawn by the seed.
        drive_lag: of the drive's set-point filter: by how much a ramp trails [s].
        drive_damping: damping ratio of the filter, which is of second order then; None: of first order.
        feedback_age: age of the measurements when they are reported [s]; a cycle or less: as old as the
            reported target.
        sample_jitter: sd of the moment at which all joints are sampled [s].
        encoder_sigma: sd of the white noise of each reported angle, (6,) [rad].
        encoder_step: quantisation of the reported angle [rad].
        speed_filter_hz: pole of the one-pole filter of each reported speed, (6,) [Hz].
        speed_dead_band: below this joint speed the filter's input is gated to zero [rad/s].
        speed_sigma: sd of the white noise of the reported speed while moving [rad/s].
        speed_least: a reported speed that decays to less than this is 0 [rad/s].
        current_sigma: sd of the white noise of the reported current, (6,) [A].
        current_step: quantisation of the reported current, (6,) [A].
        current_ripple: rms of the motors' ripple in the reported current, 404 cycles a joint turn, (6,) [A].
        servo_dead_band: error of a joint that its servo does not trim away [rad].
        backlash: play of each gear [rad]; within it the joint stands still while the motor turns.
        friction_presliding: angle over which the friction of a joint follows a reversal [rad]: it depends on
            the path then, with hysteresis (`plant/friction.py`). 0: it depends on the speed alone.
        friction_rise: speed over which the true dry friction grows from zero to its size [rad/s]. Far below
            `REVERSAL_SPEED` it holds resting joints; above it the controller's compensation would push slow
            joints ahead.
        friction_error: sd of the relative error of the controller's friction model, per joint [1].
        mass_error: sd of the relative error of each link's mass in the controller's model [1].
        calibration: factor on the factory calibrations of the arm's type (`calibration.py`) [1].
        force_drift: sd of the steady drift of the measured force [N/s].
        force_sigma: sd of the measured force, beside what the currents give to an estimated one [N].
        force_offset: bound of its constant offset, which a zero takes away [N].
        force_ratio: of these three to those of the measured moments [1/m].
        accelerometer_sigma: sd of each axis of the tool accelerometer [m/s²].
        voltage_sigma: sd of each joint voltage [V].
        voltage_offset: bound of its constant offset [V].
        has_physics: False: the arm is at its target, and the numbers above have no effect.
    """

    name: str
    dead_time: Time
    dead_time_wander: Time
    dead_time_period: Annotated[float, number(0.1, 600.0, "s")]
    drive_lag: Time
    drive_damping: Annotated[float, number(0.1, 5.0)] | None
    feedback_age: Time
    sample_jitter: Annotated[float, number(0.0, 0.01, "s")]
    encoder_sigma: SixAngles
    encoder_step: Annotated[float, number(1e-9, 0.1, "rad")]
    speed_filter_hz: tuple[Pole, Pole, Pole, Pole, Pole, Pole]
    speed_dead_band: Annotated[float, number(0.0, 1.0, "rad/s")]
    speed_sigma: Annotated[float, number(0.0, 1.0, "rad/s")]
    speed_least: Annotated[float, number(0.0, 1.0, "rad/s")]
    current_sigma: SixNoises
    current_step: tuple[Step, Step, Step, Step, Step, Step]
    current_ripple: SixNoises
    servo_dead_band: Angle
    ripples: Annotated[tuple[Ripple, ...], Items(0, 20)]
    backlash: Angle
    friction_presliding: Angle
    friction_rise: Annotated[float, number(1e-7, 1.0, "rad/s")]
    friction_error: Share
    mass_error: Share
    calibration: Annotated[float, number(0.0, 10.0)]
    force_drift: Noise
    force_sigma: Noise
    force_offset: Noise
    force_ratio: Annotated[float, number(0.1, 1000.0)]
    accelerometer_sigma: Noise
    voltage_sigma: Noise
    voltage_offset: Noise
    has_physics: bool = True

    def __post_init__(self) -> None:
        if self.drive_damping is not None and not self.drive_lag:
            raise ValueError("drive_damping", "a filter of second order has a lag; give drive_lag above 0")
        for joint in range(6):
            slope = add_up(2.0**0.5 * ripple.rms for ripple in self.ripples if joint in ripple.joints)
            if slope > _LARGEST_SLOPE:
                raise ValueError(
                    "ripples",
                    f"the waves of joint {joint} change its speed by up to {slope:.0%}; give smaller rms, "
                    f"together less than {_LARGEST_SLOPE:.0%} / sqrt(2)",
                )


def read_fidelity(path: Path, fidelities: Sequence[Fidelity]) -> Fidelity:
    """The fidelity of a file: `base`, one of those of a generation, and other values of its fields.

    ModelError if the file cannot be read, or a field does not exist or cannot hold its value.
    """
    values = _FILE.read_toml(path)
    bases = {it.name: it for it in fidelities if it.has_physics}
    base = bases[checked(word(bases), values.pop("base", TYPICAL.name), f"{path}: base", ModelError)]
    own = {field.name: getattr(base, field.name) for field in fields(base)} | {"name": path.stem}
    known = own.keys() - {"name", "has_physics"}
    for name in values:
        if name not in known:
            raise ModelError(f"{path}: {name}: no such key; {nearest(name, sorted(known))}")
    return checked(Fidelity, {**own, **values}, str(path), ModelError)


def dead_cycles(fidelity: Fidelity, seed: int, period: float) -> list[int]:
    """Return the dead time of a box in cycles of `period` [s]; several values take turns, one a cycle."""
    n = round(fidelity.dead_time_period / period) if fidelity.dead_time_wander else 1
    begin = random_stream(seed, "wander").uniform()
    share = 0.5 - 0.5 * np.cos(2.0 * np.pi * (begin + np.arange(n) / n))
    dead_times = fidelity.dead_time + fidelity.dead_time_wander * share
    return [int(cycles) for cycles in np.rint(dead_times / period)]


def _ripples(scale: float) -> tuple[Ripple, ...]:
    """Waves of a UR3's gears, times `scale`: a slow one, then once and twice a motor turn.

    F: the first is .15 to .2 mrad rms of all joints; all together the speed ripple is .3 to .5 % of the base,
    .5 to .7 of the shoulder, .8 to 1.2 of the others.
    """
    slow = Ripple(cycles=17.0, rms=0.0034 * scale)
    parts = (((0,), 0.0015), ((1,), 0.005), ((2, 3, 4, 5), 0.008))
    return slow, *(
        Ripple(cycles=cycles, rms=share * rms * scale, joints=joints)
        for cycles, share in ((101.0, 0.8), (202.0, 0.6))
        for joints, rms in parts
    )


TYPICAL = Fidelity(
    name="typical",
    dead_time=0.016,  # B: two cycles; with the rest 28 ms from command to measurement
    dead_time_wander=0.0,
    dead_time_period=5.0,
    drive_lag=0.0005,  # F: actual_q is .54 ms behind target_q
    drive_damping=None,
    feedback_age=0.008,  # B: the packet carries the state of one cycle before
    sample_jitter=1e-5,  # A: more would show in the differences of reported angles
    encoder_sigma=(2.2e-5,) * 6,  # F: with the step 2.0 to 2.4e-5
    encoder_step=2.0 * pi / 2**19,  # F, G
    speed_filter_hz=(40.0,) * 6,  # F: 2.6 ms behind the target, of which the angles are .5
    speed_dead_band=1e-4,  # F: larger ones are reported at rest, too
    speed_sigma=5e-4,  # F: what is left of 2 to 7 mrad/s after the ripple
    speed_least=1e-5,  # F: exactly 0 at rest, or single values above this
    current_sigma=(0.0035, 0.007, 0.004, 0.0045, 0.0045, 0.0045),  # F: the mean of three files
    current_step=(0.002243, 0.002243, 0.001525, 0.001119, 0.001119, 0.001119),  # F
    current_ripple=(0.055, 0.053, 0.06, 0.06, 0.055, 0.055),  # F
    ripples=_ripples(1.0),
    servo_dead_band=7.5e-5,  # F: resting joints are up to that off their targets, each by its own constant
    backlash=0.0,  # of strain wave gears; E
    friction_presliding=0.0,
    # F: three quarters are there at .002 rad/s. Resting arms carry currents beyond gravity, sd .08 A of a
    # UR3, .26 A of a UR5: what friction carries at rest fades within 4 s (base) to 11 s (wrists) (E).
    friction_rise=3e-5,
    friction_error=0.15,  # E: friction changes with temperature by more than that
    mass_error=0.02,  # E
    calibration=1.0,  # C
    force_drift=0.0,
    force_sigma=0.0,  # F: that of the currents gives .17 to .31 N
    force_offset=0.0,  # F: what friction bears at rest gives means of the axes from -6.5 to 5.6 N
    force_ratio=10.0,
    accelerometer_sigma=0.05,  # E
    voltage_sigma=0.02,  # F
    voltage_offset=0.1,  # F: joints from 47.81 to 48.02 V
)

IDEAL = replace(
    TYPICAL,
    name="ideal",
    dead_time=0.0,
    drive_lag=0.0,
    sample_jitter=0.0,
    encoder_sigma=(1e-6,) * 6,
    encoder_step=1e-7,
    speed_sigma=1e-5,
    current_sigma=(0.001,) * 6,
    current_step=(1e-6,) * 6,
    current_ripple=(0.0,) * 6,
    speed_filter_hz=(368.0, 368.0, 217.0, 138.0, 138.0, 138.0),  # A: by joint size 2, 1, 0
    ripples=(Ripple(cycles=101.0, rms=0.0002), Ripple(cycles=202.0, rms=0.0002)),
    servo_dead_band=0.0,
    friction_rise=REVERSAL_SPEED,
    friction_error=0.0,
    mass_error=0.0,
    calibration=0.0,  # like the vendor's simulator: the nominal table itself
    accelerometer_sigma=0.001,
    voltage_sigma=0.001,
    voltage_offset=0.0,
)

EXACT = replace(IDEAL, name="exact", has_physics=False, ripples=())

POOR = replace(
    TYPICAL,
    name="poor",
    dead_time=0.024,
    drive_lag=0.002,
    feedback_age=0.010,
    sample_jitter=5e-5,
    ripples=_ripples(2.0),
    servo_dead_band=1.5e-4,
    friction_error=0.30,
    mass_error=0.04,
)
