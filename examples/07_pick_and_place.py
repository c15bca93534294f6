"""Pick a block up with a gripper and put it elsewhere, again and again, by a program that calls its port.

The program is what runs on a robot with Robotiq's software: it calls port 63352 of its own controller.
"""

from __future__ import annotations

import argparse
import sys

from ur_emulator import ControlBox

PROGRAM = """
def pick_and_place():
  set_tcp(p[0, 0, 0.15, 0, 0, 0])
  set_payload(0.9, [0, 0, 0.058])
  socket_open("127.0.0.1", 63352, "gripper")

  def set(line):
    socket_send_line(line, "gripper")
    socket_read_byte_list(3, "gripper")
  end

  def activate():
    set("SET ACT 1")
    while socket_get_var("STA", "gripper") != 3:
      sync()
    end
  end

  # Close or open the fingers; returns what stopped them: 2 an object, 3 nothing.
  def grip(position):
    socket_send_string("SET POS ", "gripper")
    socket_send_string(position, "gripper")
    set(" SPE 255 FOR 80 GTO 1")
    while socket_get_var("PRE", "gripper") != position:
      sync()
    end
    while socket_get_var("OBJ", "gripper") == 0:
      sync()
    end
    return socket_get_var("OBJ", "gripper")
  end

  def carry(there, to):
    movel(pose_trans(there, p[0, 0, -0.1, 0, 0, 0]), a=1.0, v=0.5)
    movel(there, a=0.5, v=0.15)
    if grip(255) != 2:
      textmsg("lost at ", there)
      halt
    end
    set_payload(1.1, [0, 0, 0.075])
    movel(pose_trans(there, p[0, 0, -0.1, 0, 0, 0]), a=0.5, v=0.25)
    movel(pose_trans(to, p[0, 0, -0.1, 0, 0, 0]), a=1.0, v=0.5)
    movel(to, a=0.5, v=0.15)
    grip(0)
    set_payload(0.9, [0, 0, 0.058])
    movel(pose_trans(to, p[0, 0, -0.1, 0, 0, 0]), a=0.5, v=0.25)
  end

  left = p[0.5, 0.2, 0, 3.14159, 0, 0]
  right = p[0.5, -0.2, 0, 3.14159, 0, 0]
  activate()
  movej(get_inverse_kin(pose_trans(left, p[0, 0, -0.1, 0, 0, 0])), a=1.0, v=0.8)
  n = 0
  while n < TIMES:
    carry(left, right)
    carry(right, left)
    n = n + 1
  end
  textmsg("carried ", 2 * n)
end
"""


def main() -> int:
    parser = argparse.ArgumentParser(description="Pick a block up and put it elsewhere.")
    parser.add_argument("--times", type=int, default=3, help="how often there and back")
    options = parser.parse_args()
    with ControlBox("ur5e", pace="lockstep", port_base=None, seed=7, tool="robotiq-2f85") as box:
        box.add_thing("block", "box", (0.04, 0.04, 0.04), 0.2, (0.5, 0.2, 0.0, 0, 0, 0))
        box.run_program(PROGRAM.replace("TIMES", str(options.times)), wait=True)
        (block,) = box.state.things
        print(f"the block is at {block.pose[0]:.4f}, {block.pose[1]:.4f}, {block.pose[2]:.4f} m")
        print([entry.text for entry in box.log if entry.text.startswith(("carried", "lost"))])
    return 0


if __name__ == "__main__":
    sys.exit(main())
