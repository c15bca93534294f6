"""Guide the arm by hand, press on its table, drive it into the table; docs/contact.md shows what happens."""

import socket
from collections.abc import Iterator

from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import MAX_PACKAGE_SIZE
from protocol.primary.messages import ErrorCodeMessage, KeyMessage, TextMessage
from protocol.primary.packages import Package, decode_package
from protocol.ur_types import SoftwareVersion
from ur_emulator import ControlBox

GUIDE = """def guide():
  movej(p[0.3, 0, 0.2, 3.1416, 0, 0])
  start = get_actual_tcp_pose()
  freedrive_mode()
  sleep(0.8)
  end_freedrive_mode()
  textmsg("the hand has moved the tool by [m] ", point_dist(start, get_actual_tcp_pose()))
end
"""
PRESS = """def press():
  movel(p[0.3, 0, 0.03, 3.1416, 0, 0])
  sleep(1)
  zero_ftsensor()
  force_mode(p[0,0,0,0,0,0], [0,0,1,0,0,0], [0,0,-30,0,0,0], 2, [0.02,0.02,0.05,0.1,0.1,0.1])
  sleep(4)
  sum = 0
  n = 0
  while n < 100:
    sum = sum + force()
    n = n + 1
    sync()
  end
  textmsg("asked for 30 N, felt on average [N] ", sum / 100)
  end_force_mode()
  movel(p[0.3, 0, 0.1, 3.1416, 0, 0])
end
"""
CRASH = """def crash():
  movel(p[0.3, 0, -0.1, 3.1416, 0, 0], v=0.1)
end
"""


def main() -> None:
    with ControlBox(pace="lockstep", seed=7, port_base=None) as box:
        primary = socket.create_connection((box.host, box.ports.primary), timeout=10.0)
        with primary, socket.create_connection((box.host, box.ports.secondary)) as secondary:
            said = messages(primary)
            for program, push in ((GUIDE, 15.0), (PRESS, 0.0), (CRASH, 0.0)):
                box.push((0.0, push, 0.0))  # a hand at the flange [N]
                secondary.sendall(program.encode())
                for message in said:
                    match message:
                        case TextMessage(text=text):
                            print(text)
                        case ErrorCodeMessage(code=code, argument=argument, text=text):
                            print(f"C{code}A{argument} {text}")
                            break
                        case KeyMessage(title="PROGRAM_XXX_STOPPED"):
                            break


def messages(primary: socket.socket) -> Iterator[Package]:
    """Everything that the primary port says."""
    buffer = FrameBuffer(MAX_PACKAGE_SIZE)
    while True:
        while (frame := buffer.next_frame()) is None:
            buffer.feed(primary.recv(65536))
        yield decode_package(frame, SoftwareVersion.parse("3.15.8"))


if __name__ == "__main__":
    main()
