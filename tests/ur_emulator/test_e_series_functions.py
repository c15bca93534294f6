"""What programs exported from an e-Series begin with: taken by a box that pretends to run its software."""

import pytest
from program_support import Box

EXPORT = b"""def exported():
  set_tool_communication(False, 115200, 0, 1, 1.5, 3.5)
  set_tool_output_mode(0)
  set_tool_digital_output_mode(1, 3)
  set_target_payload(0.5, [0.0, 0.0, 0.05], [0.001, 0.001, 0.001, 0.0, 0.0, 0.0])
  textmsg(get_target_payload(), get_target_payload_cog())
end
"""


def run(line, software="5.11"):
    box = Box(software=software)
    box.send(b"def exported():\n  " + line + b"\nend\n")
    box.finish()
    return box.failures


def test_the_preamble_of_an_export_runs_and_sets_the_payload():
    box = Box(software="5.11")
    box.send(EXPORT)
    assert box.finish() == ["0.5[0,0,0.05]"]
    assert box.failures == []


def test_a_cb3_does_not_know_it():
    box = Box(software="3.15")
    box.send(EXPORT)
    assert [error.wire_text for error in box.compile_errors] == [
        "compile_error_name_not_found:set_tool_communication:"
    ]


@pytest.mark.parametrize(
    ("line", "part"),
    [
        (
            b"set_tool_communication(True, 1200, 0, 1, 1.5, 3.5)",
            "baud rate 1200 is not supported; allowed: 9600",
        ),
        (b"set_tool_output_mode(2)", "set_tool_output_mode"),
        (b"set_target_payload(0.5, [0, 0, 0], [-1, 0, 0, 0, 0, 0])", "the first three not below 0"),
        (b"set_target_payload(0.5, [0, 0, 0], [0, 0, 0, 134, 0, 0])", "up to 133 kg m^2"),
        (b"set_target_payload(50, [0, 0, 0])", "a payload of 50 kg is out of range"),
    ],
)
def test_what_is_out_of_range_is_refused(line, part):
    (failure,) = run(line)
    assert part in failure


def test_settings_of_the_tool_are_reported():
    box = Box(software="5.11")
    box.send(b"set_tool_communication(True, 1000000, 2, 1, 2.0, 4.5)\n")
    box.finish()
    assert box.now.tool_line == (True, 1_000_000, 2, 1, 2.0, 4.5)


def test_tool_pose_is_where_the_tool_is():
    box = Box(software="3.15")
    box.send(b"textmsg(tool_pose() == get_actual_tcp_pose())\n")
    assert box.finish() == ["True"]
