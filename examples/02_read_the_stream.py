"""Read the realtime stream of a box (or of a real arm: give its address), print the joints every second."""

import argparse
import socket
from collections.abc import Iterable, Iterator

import numpy as np

from protocol.frame_buffer import FrameBuffer
from protocol.realtime.layout import MAX_FRAME_SIZE, RealtimeFrame, layout_for_size
from ur_emulator import ControlBox


def read_frames(address: tuple[str, int], n: int) -> Iterator[RealtimeFrame]:
    buffer = FrameBuffer(MAX_FRAME_SIZE)
    with socket.create_connection(address, timeout=5.0) as sock:
        while n:
            while (frame := buffer.next_frame()) is None:
                buffer.feed(sock.recv(65536))
            yield layout_for_size(len(frame)).decode(frame)
            n -= 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", help="address of an arm; without it a box is started here")
    parser.add_argument("--seconds", type=float, default=2.0)
    options = parser.parse_args()
    n = int(options.seconds * 125)
    if options.robot:
        show(read_frames((options.robot, 30003), n))
    else:
        with ControlBox(port_base=None) as box:
            show(read_frames((box.host, box.ports.realtime), n))


def show(frames: Iterable[RealtimeFrame]) -> None:
    for k, frame in enumerate(frames):
        if k % 125 == 0:
            print(f"{frame.timestamp:8.3f} s  q = {np.round(frame.actual_q, 4)} rad")


if __name__ == "__main__":
    main()
