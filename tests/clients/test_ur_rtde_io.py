"""ur_rtde's RTDEIOInterface beside the other interfaces: outputs, slider, registers; and who may have them."""

import pytest
from clients_support import wait_until
from ur_rtde_support import RTDEIO, RTDEControl, RTDEReceive, connected, home

VOLTAGE_RANGE, CURRENT_RANGE = 10.0, (0.004, 0.020)  # V, A
DIGITAL_OUTPUTS = 18


@pytest.fixture
def pair(box):
    """An I/O interface and a receiver that sees what it does."""
    with connected(RTDEIO, box.host) as io, connected(RTDEReceive, box.host) as receive:
        yield io, receive


def test_every_digital_output_goes_on_and_off(pair):
    io, receive = pair
    setters = (
        [(io.setStandardDigitalOut, n) for n in range(8)]
        + [(io.setConfigurableDigitalOut, n) for n in range(8)]
        + [(io.setToolDigitalOut, n) for n in range(2)]
    )
    assert len(setters) == DIGITAL_OUTPUTS
    for bit, (setter, n) in enumerate(setters):
        assert setter(n, True)
        wait_until(lambda bit=bit: receive.getActualDigitalOutputBits() == (2 << bit) - 1, f"output {bit}")
        assert receive.getDigitalOutState(bit)
    for bit, (setter, n) in enumerate(setters):
        assert setter(n, False)
        wait_until(lambda bit=bit: not receive.getDigitalOutState(bit), f"the end of output {bit}")
    assert receive.getActualDigitalOutputBits() == 0


def test_analog_outputs_in_both_domains(pair):
    io, receive = pair
    getters = receive.getStandardAnalogOutput0, receive.getStandardAnalogOutput1
    for n, getter in enumerate(getters):
        other = getters[1 - n]()
        assert io.setAnalogOutputVoltage(n, 0.25)
        wait_until(lambda getter=getter: getter() == pytest.approx(0.25 * VOLTAGE_RANGE))
        assert getters[1 - n]() == other, "the channel that is not selected carries rubbish"
        assert io.setAnalogOutputCurrent(n, 0.5)
        wait_until(lambda getter=getter: getter() == pytest.approx(sum(CURRENT_RANGE) / 2))
        assert io.setAnalogOutputCurrent(n, 0.0)
        wait_until(lambda getter=getter: getter() == pytest.approx(CURRENT_RANGE[0]))


def test_the_speed_slider_slows_the_arm(arm):
    with connected(RTDEIO, arm.box.host) as io:
        try:
            assert io.setSpeedSlider(0.3)
            arm.until(lambda r: r.getTargetSpeedFraction() == pytest.approx(0.3))
            assert arm.control.moveJ(home(0.25), 1.0, 8.0, True)
            _, rates, combined = arm.trace(
                lambda: arm.control.getAsyncOperationProgress() >= 0, "TargetQd", "SpeedScalingCombined"
            )
            assert rates[:, 0].max() == pytest.approx(0.3, abs=1e-3)
            assert combined[-1] == pytest.approx(0.3, abs=0.02)
        finally:
            assert io.setSpeedSlider(1.0)
            arm.until(lambda r: r.getTargetSpeedFraction() == 1.0)


def copying(*numbers, by):
    """Return lines that copy input registers, once the last has come, to output registers with lower numbers."""
    last = numbers[-1]
    return f"while read_input_float_register({last}) != {last / 8}:\n  sync()\nend\n" + "".join(
        f"write_output_integer_register({n - by}, read_input_integer_register({n}))\n"
        f"write_output_float_register({n - by}, read_input_float_register({n}))\n"
        for n in numbers
    )


def test_registers_reach_a_program(arm):
    """Written by the I/O interface, copied by a program of ours to where the receiver sees them."""
    numbers = range(18, 23)
    with connected(RTDEIO, arm.box.host) as io:
        for n in numbers:
            assert io.setInputIntRegister(n, 100 + n)
            assert io.setInputDoubleRegister(n, n / 8)
        assert arm.control.sendCustomScriptFunction("copy_registers", copying(*numbers, by=6))
    for n in numbers:
        wait_until(lambda n=n: arm.receive.getOutputIntRegister(n - 6) == 100 + n)
        wait_until(lambda n=n: arm.receive.getOutputDoubleRegister(n - 6) == n / 8)


def test_reconnecting(pair):
    io, receive = pair
    io.disconnect()
    assert not io.isConnected()
    assert io.reconnect()
    assert io.setStandardDigitalOut(3, True)
    wait_until(lambda: receive.getDigitalOutState(3))
    assert io.setStandardDigitalOut(3, False)
    wait_until(lambda: not receive.getDigitalOutState(3))


def test_only_one_client_has_an_input(arm):
    """As on the real box: the second of two like clients is told that the registers are in use."""
    with pytest.raises(RuntimeError, match="in use"):
        RTDEControl(arm.box.host)
    with connected(RTDEIO, arm.box.host), pytest.raises(RuntimeError, match="in use"):
        RTDEIO(arm.box.host)
    with connected(RTDEIO, arm.box.host) as later:
        assert later.isConnected()
    assert arm.control.moveJ(home(0.05), 2.0, 8.0)


def test_the_upper_registers_are_free_beside_the_lower(arm):
    with (
        connected(RTDEIO, arm.box.host, False, True) as io,
        connected(RTDEReceive, arm.box.host, 125.0, [], False, True) as receive,
    ):
        for n in (42, 43):
            assert io.setInputIntRegister(n, n + 7)
            assert io.setInputDoubleRegister(n, n / 8)
        assert arm.control.sendCustomScriptFunction("copy_upper", copying(42, 43, by=6))
        for n in (42, 43):
            wait_until(lambda n=n: receive.getOutputIntRegister(n - 6) == n + 7)
            wait_until(lambda n=n: receive.getOutputDoubleRegister(n - 6) == n / 8)
