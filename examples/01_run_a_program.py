"""Start a box, send it a program as any client does, read what it says on the primary port."""

import socket

from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import MAX_PACKAGE_SIZE
from protocol.primary.messages import KeyMessage, RuntimeExceptionMessage, TextMessage
from protocol.primary.packages import decode_package
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox

PROGRAM = b"""def hello():
  textmsg("the tool is at ", get_actual_tcp_pose())
  movej([0.5, -1.5, -1.8, 0.0, 1.2, 1.5], a=1.4, v=1.0)
  textmsg("and now at ", get_actual_tcp_pose())
end
"""


def main() -> None:
    with ControlBox(pace="lockstep", seed=7, port_base=None) as box:
        primary = socket.create_connection((box.host, box.ports.primary), timeout=10.0)
        with primary, socket.create_connection((box.host, box.ports.secondary)) as secondary:
            secondary.sendall(PROGRAM)
            buffer = FrameBuffer(MAX_PACKAGE_SIZE)
            while True:
                while (frame := buffer.next_frame()) is None:
                    buffer.feed(primary.recv(65536))
                match decode_package(frame, SoftwareVersion.parse("3.15.8")):
                    case TextMessage(text=text):
                        print(text)
                    case RuntimeExceptionMessage(line=line, column=column, text=text):
                        print(f"line {line}, column {column}: {text}")
                    case KeyMessage(title="PROGRAM_XXX_STOPPED"):
                        return


if __name__ == "__main__":
    main()
