"""Messages that say where a program stands in PolyScope's tree, four ways."""

import pytest
from test_protocol_program_variables import NO_TIME, V3_15, read

from protocol.errors import RemoteProtocolError
from protocol.primary import messages as M
from protocol.primary.framing import encode_package
from protocol.primary.packages import encode_message_package
from protocol.ur_types import SoftwareVersion

TWO = M.ProgramThreadsMessage(
    threads=(
        M.ThreadLabel(label_id=3, text="Move", thread_name="main"),
        M.ThreadLabel(label_id=-1, thread_name="t"),
    )
)
MESSAGES = [
    ("3.2", M.ProgramLabelMessage(label_id=12, text="Wait"), f"00000017 14 {NO_TIME} fd 01 0000000c 57616974"),
    ("3.15.8", TWO,
     f"00000030 14 {NO_TIME} fd 0e 00000003 00000004 4d6f7665 00000004 6d61696e ffffffff 00000000 00000001 74"),
    ("3.15.8", M.ProgramThreadsMessage(timestamp=8000), "0000000f 14 0000000000001f40 fd 0e"),
]  # fmt: skip


@pytest.mark.parametrize(("version", "message", "data"), MESSAGES)
def test_messages_by_four_methods(version, message, data):
    version, data = SoftwareVersion.parse(version), bytes.fromhex(data)
    assert encode_message_package(message, version).hex(" ") == data.hex(" ")
    assert read(data, version) == [message]
    assert read(data, version, step=1) == [message]
    assert read(data + data[:7], version) == [message]


def test_a_threads_message_ends_between_threads_only():
    data = encode_message_package(TWO, V3_15)
    whole = {15: 0, 35: 1, 48: 2}  # bytes to threads
    for end in range(15, len(data) + 1):
        package = encode_package(20, data[5:end])
        if end in whole:
            assert len(read(package)[0].threads) == whole[end]
        else:
            with pytest.raises(RemoteProtocolError):
                read(package)


@pytest.mark.parametrize("length", ["ffffffff", "7fffffff", "00000005"])
def test_a_text_longer_than_its_package_is_refused(length):
    body = bytes.fromhex(f"{NO_TIME} fd 0e 00000001 {length} 41")
    with pytest.raises(RemoteProtocolError, match="cut off"):
        read(encode_package(20, body))
