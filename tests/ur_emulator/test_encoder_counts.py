"""Conveyor encoders: counts that programs feed, and pulses on inputs."""

import pytest
from box_support import Bench
from hypothesis import given
from hypothesis import strategies as st

from ur_emulator.controller.io.encoders import RANGES, Decoder, Encoder

QUADRATURE = ((0, 0), (1, 0), (1, 1), (0, 1))


def texts(*lines):
    bench = Bench()
    result = bench.run("def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n")
    return result + [event.text for event in bench.events if type(event).__name__ == "ScriptFailed"]


def test_a_program_feeds_an_encoder():
    assert texts(
        "encoder_enable_set_tick_count(1, 0)",
        "encoder_set_tick_count(1, -123)",
        "textmsg(encoder_get_tick_count(1) == -123)",
        "textmsg(encoder_get_tick_count(0) == 0)",
    ) == ["True", "True"]


@pytest.mark.parametrize(("range_id", "low", "high"), [(0, -(2**31), 2**31 - 1), (1, 0, 255), (2, 0, 65535)])
def test_counts_outside_the_range(range_id, low, high):
    for count in (low - 1.0, high + 1.0):
        (text,) = texts(
            f"encoder_enable_set_tick_count(0, {range_id})", f"encoder_set_tick_count(0, {count})"
        )
        assert f"allowed: {low} to {high}" in text
    for count in (low, high):
        assert not texts(
            f"encoder_enable_set_tick_count(0, {range_id})", f"encoder_set_tick_count(0, {count:.1f})"
        )


def test_an_encoder_that_is_not_fed_takes_no_count():
    (text,) = texts("encoder_set_tick_count(0, 1)")
    assert "encoder_enable_set_tick_count" in text


def test_unwind_in_a_script():
    assert texts("textmsg(encoder_unwind_delta_tick_count(0, 250))") == ["None"]
    assert texts(
        "encoder_enable_set_tick_count(0, 1)",
        "textmsg(encoder_unwind_delta_tick_count(0, 250) == -6)",
        "textmsg(encoder_unwind_delta_tick_count(0, -250) == 6)",
        "textmsg(encoder_unwind_delta_tick_count(0, 100) == 100)",
    ) == ["True", "True", "True"]


@given(st.sampled_from(sorted(RANGES)), st.data())
def test_unwind_finds_the_difference_of_two_counts(range_id, data):
    low, size = RANGES[range_id]
    encoder = Encoder()
    encoder.feed(range_id)
    start = data.draw(st.integers(low, low + size - 1))
    way = data.draw(st.integers(-(size // 2) + 1, size // 2 - 1))
    end = (start + way - low) % size + low
    assert encoder.unwind(end - start) == way


def pulses(decoder, steps, pins=(0, 1)):
    bench = Bench()
    bench.run(f"def p():\n  encoder_enable_pulse_decode(0, {decoder}, {pins[0]}, {pins[1]})\nend\n")
    for a, b in steps:
        bench.controller.state.io.digital_in = a << (pins[0] % 8) | b << (pins[1] % 8)
        bench.tick()
    return bench.controller.state.encoders.encoders[0].count


def test_quadrature_counts_in_both_directions():
    assert pulses(1, QUADRATURE[1:] + QUADRATURE) == 7
    assert pulses(1, (QUADRATURE[1], QUADRATURE[2], QUADRATURE[1])) == 1
    assert pulses(1, QUADRATURE[:0:-1]) == 65536 - 3
    assert pulses(1, (QUADRATURE[2], QUADRATURE[0])) == 0


@pytest.mark.parametrize(("decoder", "count"), [(0, 0), (2, 5), (3, 3), (4, 2)])
def test_single_line_decoders(decoder, count):
    assert pulses(decoder, [(a, 0) for a in (1, 0, 1, 0, 1)]) == count


def test_other_pins_and_their_later_numbers():
    assert pulses(3, [(1, 0), (0, 0), (1, 0)], pins=(3, 2)) == 2
    assert pulses(3, [(1, 0), (0, 0), (1, 0)], pins=(11, 10)) == 2
    (text,) = texts("encoder_enable_pulse_decode(0, 1, 4, 5)")
    assert "digital input 4 cannot take encoder pulses" in text


def test_feeding_ends_decoding():
    encoder = Encoder()
    encoder.decode(Decoder.RISING, 0, 1, 0)
    encoder.feed(4)
    assert encoder.decoder is Decoder.OFF
    assert encoder.is_enabled


def test_old_forms_speak_of_the_first_encoder():
    assert texts(
        "set_conveyor_tick_count(200, 1)",
        "textmsg(get_conveyor_tick_count() == 200)",
        "textmsg(encoder_get_tick_count(0) == 200)",
        "conveyor_pulse_decode(1, 0, 1)",
        "textmsg(get_conveyor_tick_count() == 0)",
    ) == ["True", "True", "True"]
    (text,) = texts("set_conveyor_tick_count(300, 1)")
    assert "allowed: 0 to 255" in text
