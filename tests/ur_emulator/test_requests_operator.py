"""What programs ask of the operator: values and popups, answered by a client."""

import math

import pytest
from box_support import VERSION, Bench, MessageReader, connect

from protocol.primary.messages import (
    PopupMessage,
    RequestedType,
    RequestValueMessage,
    TextMessage,
    decode_message,
    encode_message,
)
from ur_emulator.commands.programs import AnswerRequest, ClosePopup, StopProgram
from ur_emulator.emulator import ControlBox
from ur_emulator.errors import ArgumentError


def asking(kind):
    bench = Bench()
    bench.start(
        f'def p():\n  x = request_{kind}_from_primary_client("how many?")\n  textmsg("got ", x)\nend\n'
    )
    return bench


def printed(bench):
    return [event.text for event in bench.events if type(event).__name__ == "TextPrinted"]


@pytest.mark.parametrize(
    ("kind", "requested", "answer", "text"),
    [
        ("boolean", RequestedType.BOOLEAN, True, "True"),
        ("integer", RequestedType.INTEGER, -3, "-3"),
        ("float", RequestedType.FLOAT, 2.5, "2.5"),
        ("string", RequestedType.STRING, "abc", "abc"),
    ],
)
def test_a_program_waits_for_its_answer(kind, requested, answer, text):
    bench = asking(kind)
    (event,) = [event for event in bench.events if type(event).__name__ == "ValueRequested"]
    assert (event.kind, event.text) == (requested, "how many?")
    bench.tick(50)
    assert bench.controller.waits_outside
    bench.tick(1, AnswerRequest(answer, event.request_id))
    assert printed(bench) == [f"got {text}"]
    assert not bench.controller.state.pendant.requests


@pytest.mark.parametrize(("answer", "text"), [("\u20acuro", "6"), ("", "0")])
def test_a_text_has_one_character_for_each_byte_of_utf_8(answer, text):
    bench = Bench()
    bench.start('def p():\n  textmsg(str_len(request_string_from_primary_client("?")))\nend\n')
    bench.tick(2, AnswerRequest(answer))
    assert printed(bench) == [text]


@pytest.mark.parametrize("answer", ["\ud800", "x" * 1001, math.nan, None])
def test_what_is_no_answer_at_all_cannot_be_given(answer):
    with pytest.raises(ArgumentError, match=r"^value .* given: allowed is true, false, number or text$"):
        AnswerRequest(answer)


@pytest.mark.parametrize(
    "wrong",
    [AnswerRequest(True), AnswerRequest(1.5), AnswerRequest(10**12), AnswerRequest(1, 99), ClosePopup()],
)
def test_wrong_answers_change_nothing(wrong):
    bench = asking("integer")
    bench.tick(3, wrong)
    assert bench.controller.programs.is_running
    bench.tick(1, AnswerRequest(4))
    assert printed(bench) == ["got 4"]


def test_the_rest_of_the_program_goes_on_meanwhile():
    bench = Bench()
    bench.start(
        "def p():\n  global n = 0\n  thread count():\n    while True:\n      n = n + 1\n      sync()\n    end\n"
        '  end\n  run count()\n  popup("wait", blocking=True)\n  textmsg(n)\nend\n'
    )
    bench.tick(20)
    bench.tick(1, ClosePopup())
    (text,) = printed(bench)
    assert int(text) >= 20


def test_a_blocking_popup_waits_and_another_does_not():
    bench = Bench()
    bench.start(
        'def p():\n  popup("a")\n  textmsg("shown")\n  popup("b", "title", blocking=True)\n  textmsg("closed")\nend\n'
    )
    bench.tick(30)
    assert printed(bench) == ["shown"]
    popups = [event for event in bench.events if type(event).__name__ == "PopupShown"]
    assert [(p.text, p.blocking, p.request_id) for p in popups] == [("a", False, 0), ("b", True, 1)]
    bench.tick(1, ClosePopup())
    assert printed(bench) == ["shown", "closed"]


def test_a_program_that_is_stopped_takes_its_question_away():
    bench = asking("string")
    bench.tick(1, StopProgram())
    assert bench.controller.state.pendant.requests == ()
    bench.tick(1, AnswerRequest("late"))
    assert not printed(bench)


def test_answers_go_to_the_oldest_question_of_their_type():
    bench = Bench()
    bench.start(
        'def p():\n  thread t():\n    y = request_integer_from_primary_client("b")\n    textmsg("b ", y)\n  end\n'
        '  h = run t()\n  x = request_integer_from_primary_client("a")\n  textmsg("a ", x)\n  join h\nend\n'
    )
    bench.tick(2)
    bench.tick(1, AnswerRequest(1))
    bench.tick(1, AnswerRequest(2))
    assert printed(bench) == ["a 1", "b 2"]


def test_the_message_on_the_wire():
    message = RequestValueMessage(timestamp=5, request_id=7, requested_type=RequestedType.FLOAT, text="x?")
    body = encode_message(message, VERSION)
    assert body[9:] == bytes.fromhex("09 00000007 00000002") + b"x?"
    assert decode_message(body, VERSION) == message


def test_the_dashboard_closes_popups():
    with ControlBox(pace="lockstep", port_base=None) as box, connect(box, "primary") as sock:
        reader = MessageReader(sock)
        sock.sendall(b'def p():\n  popup("press", blocking=True)\n  textmsg("on we go")\nend\n')
        popup = reader.message(PopupMessage)
        assert (popup.text, popup.is_blocking, popup.request_id) == ("press", True, 1)
        with connect(box, "dashboard") as dashboard:
            lines = dashboard.makefile("rb")
            lines.readline()
            dashboard.sendall(b"close popup\n")
            assert lines.readline() == b"closing popup\n"
            assert reader.message(TextMessage).text == "on we go"
