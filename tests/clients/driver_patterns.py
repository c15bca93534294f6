"""Programs of our own in the manner of two drivers, with the wire formats that theirs have, and their PC's side.

`headless_driver` is in the manner of Universal_Robots_Client_Library: functions used before they are defined,
lists added and multiplied, a blocking socket read inside a critical section, servo and trajectory threads, a
socket each for set-points (8 integers), trajectories (21) and commands (28), all times 1e6. `reverse_driver` is in
the manner of ur_modern_driver: an unnamed socket, messages of 7 integers, locals shared with a nested thread.
"""

import socket
import struct
from contextlib import ExitStack

from clients_support import TIMEOUT, receive_exactly

SCALE = 1_000_000
STOP, UNINITIALIZED, IDLE, SERVOJ, SPEEDJ, TRAJECTORY, SPEEDL, POSE = -2, -1, 0, 1, 2, 3, 4, 5
TRAJECTORY_START, TRAJECTORY_CANCEL = 1, -1
DONE, CANCELLED, FAILED = 0, 1, 2
MOVEJ, MOVEL = 0, 1

HEADLESS = """
MULT = 1000000
cmd_servo_state = 0
cmd_servo_q = get_actual_joint_positions()
cmd_speed = [0, 0, 0, 0, 0, 0]
trajectory_result = 0
points_left = 0
trajectory_runs = False
control_mode = {uninitialized}
read_timeout = 0.0

def set_servo_setpoint(q):
  cmd_servo_state = 1
  if check_distance(q, 0.16):
    cmd_servo_q = q
  end
end

thread servoThread():
  state = 0
  q = get_joint_positions()
  q_last = q
  missed = 0
  while control_mode == {servoj}:
    enter_critical
    q_last = q
    q = cmd_servo_q
    do_extrapolate = False
    if cmd_servo_state == 0:
      do_extrapolate = True
    end
    state = cmd_servo_state
    if cmd_servo_state > 0:
      cmd_servo_state = 0
    end
    exit_critical
    missed = missed + 1
    if not do_extrapolate:
      missed = 0
    elif missed < 5:
      q = get_target_joint_positions() + get_steptime() * get_target_joint_speeds()
    end
    servoj(q, t=get_steptime(), lookahead_time=0.03, gain=2000)
  end
  stopj(4.0)
end

thread speedjThread():
  while control_mode == {speedj}:
    speedj(cmd_speed, 10.0, get_steptime())
  end
  stopj(5.0)
end

thread speedlThread():
  while control_mode == {speedl}:
    speedl(cmd_speed, 2.0, get_steptime())
  end
  stopl(5.0)
end

thread trajectoryThread():
  enter_critical
  trajectory_result = {done}
  trajectory_runs = True
  while points_left > 0:
    local raw = socket_read_binary_integer(21, "trajectory_socket", 0.5)
    if raw[0] > 0:
      local q = [raw[1], raw[2], raw[3], raw[4], raw[5], raw[6]] / MULT
      local duration = raw[19] / MULT
      local blend = raw[20] / MULT
      points_left = points_left - 1
      if points_left == 0:
        blend = 0
      end
      if raw[21] == {movej}:
        movej(q, t=duration, r=blend)
      else:
        movel(p[q[0], q[1], q[2], q[3], q[4], q[5]], t=duration, r=blend)
      end
    else:
      trajectory_result = {failed}
      points_left = 0
    end
  end
  trajectory_runs = False
  exit_critical
  socket_send_int(trajectory_result, "trajectory_socket")
end

thread commandThread():
  while control_mode > {stop}:
    local raw = socket_read_binary_integer(28, "command_socket", 0)
    if raw[0] > 0:
      if raw[1] == 1:
        set_payload(raw[2] / MULT, [raw[3], raw[4], raw[5]] / MULT)
      elif raw[1] == 2:
        set_tool_voltage(raw[2])
      end
    end
  end
end

socket_open("{host}", {reverse}, "reverse_socket")
socket_open("{host}", {trajectory}, "trajectory_socket")
socket_open("{host}", {command}, "command_socket")
control_mode = {idle}
worker = 0
trajectory_worker = 0
commands = run commandThread()
textmsg("External control active")

while control_mode > {stop}:
  enter_critical
  params = socket_read_binary_integer(1 + 6 + 1, "reverse_socket", read_timeout)
  if params[0] > 0:
    read_timeout = params[1] / 1000.0
    if control_mode != params[8]:
      if trajectory_worker != 0:
        kill trajectory_worker
        trajectory_worker = 0
        if trajectory_runs:
          trajectory_runs = False
          points_left = 0
          stopj(4.0)
          socket_send_int({cancelled}, "trajectory_socket")
        end
      end
      control_mode = params[8]
      join worker
      worker = 0
      if control_mode == {servoj}:
        cmd_servo_q = get_joint_positions()
        worker = run servoThread()
      elif control_mode == {speedj}:
        cmd_speed = [0, 0, 0, 0, 0, 0]
        worker = run speedjThread()
      elif control_mode == {speedl}:
        cmd_speed = [0, 0, 0, 0, 0, 0]
        worker = run speedlThread()
      end
    end
    if control_mode == {servoj}:
      set_servo_setpoint([params[2], params[3], params[4], params[5], params[6], params[7]] / MULT)
    elif control_mode == {speedj} or control_mode == {speedl}:
      cmd_speed = [params[2], params[3], params[4],
                   params[5], params[6], params[7]] / MULT
    elif control_mode == {forward}:
      if params[2] == 1:
        points_left = params[3]
        trajectory_worker = run trajectoryThread()
      end
    end
  else:
    textmsg(str_cat("Socket timed out in control mode ", control_mode))
    control_mode = {stop}
  end
  exit_critical
end

def check_distance(q, limit = 0.16):
  return norm(q - get_target_joint_positions()) < limit * 6 or
    norm(q) == 0
end

join worker
kill commands
stopj(4.0)
socket_close("reverse_socket")
socket_close("trajectory_socket")
socket_close("command_socket")
textmsg("Bye")
"""

REVERSE = """def driverProg():
\tMSG_OUT = 1
\tMULT_jointstate = 1000000
\tSERVO_IDLE = 0
\tSERVO_RUNNING = 1
\tcmd_servo_state = SERVO_IDLE
\tcmd_servo_q = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
\tdef set_servo_setpoint(q):
\t\tenter_critical
\t\tcmd_servo_state = SERVO_RUNNING
\t\tcmd_servo_q = q
\t\texit_critical
\tend
\tthread servoThread():
\t\tstate = SERVO_IDLE
\t\twhile True:
\t\t\tenter_critical
\t\t\tq = cmd_servo_q
\t\t\tdo_brake = False
\t\t\tif (state == SERVO_RUNNING) and (cmd_servo_state == SERVO_IDLE):
\t\t\t\tdo_brake = True
\t\t\tend
\t\t\tstate = cmd_servo_state
\t\t\tcmd_servo_state = SERVO_IDLE
\t\t\texit_critical
\t\t\tif do_brake:
\t\t\t\tstopj(1.0)
\t\t\t\tsync()
\t\t\telif state == SERVO_RUNNING:
\t\t\t\tservoj(q, t=0.008, lookahead_time=0.03, gain=300)
\t\t\telse:
\t\t\t\tsync()
\t\t\tend
\t\tend
\tend
\tsocket_open("{host}", {port})
\tthread_servo = run servoThread()
\tkeepalive = 1
\twhile keepalive > 0:
\t\tparams_mult = socket_read_binary_integer(6+1)
\t\tif params_mult[0] > 0:
\t\t\tq = [params_mult[1] / MULT_jointstate, params_mult[2] / MULT_jointstate, params_mult[3] / MULT_jointstate, \
params_mult[4] / MULT_jointstate, params_mult[5] / MULT_jointstate, params_mult[6] / MULT_jointstate]
\t\t\tkeepalive = params_mult[7]
\t\t\tset_servo_setpoint(q)
\t\tend
\tend
\tsleep(.1)
\tsocket_close()
\tkill thread_servo
end
"""


def headless_driver(host, reverse, trajectory, command):
    """Return what one write on the primary port uploads: a stop, then the program with tabs."""
    body = HEADLESS
    values = {
        "host": host, "reverse": reverse, "trajectory": trajectory, "command": command,
        "stop": STOP, "uninitialized": UNINITIALIZED, "idle": IDLE, "servoj": SERVOJ, "speedj": SPEEDJ,
        "forward": TRAJECTORY, "speedl": SPEEDL, "done": DONE, "cancelled": CANCELLED, "failed": FAILED,
        "movej": MOVEJ,
    }  # fmt: skip
    for name, value in values.items():
        body = body.replace("{" + name + "}", str(value))
    lines = "".join(f"\t{line}\n" for line in body.splitlines())
    return f"stop program\ndef externalControl():\n{lines}end\n"


class DriverServers:
    """The servers of the PC that a headless driver's program dials."""

    def __init__(self):
        self._stack = ExitStack()
        self.servers = [self._stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(3)]
        for server in self.servers:
            server.settimeout(TIMEOUT)
        self.ports = [server.getsockname()[1] for server in self.servers]

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._stack.close()

    def accept(self):
        """Wait for the three connections."""
        sockets = [self._stack.enter_context(server.accept()[0]) for server in self.servers]
        for sock in sockets:
            sock.settimeout(TIMEOUT)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.reverse, self.trajectory, self.command = sockets

    def send(self, mode, values=(0,) * 6, timeout_ms=200):
        """Send a set-point; values in rad or m and their rates."""
        scaled = [round(v * SCALE) for v in values]
        self.reverse.sendall(struct.pack(">8i", timeout_ms, *scaled, mode))

    def forward(self, action, points, timeout_ms=0):
        """Announce a trajectory: plain integers, not scaled."""
        self.reverse.sendall(struct.pack(">8i", timeout_ms, action, points, 0, 0, 0, 0, TRAJECTORY))

    def point(self, q, duration, blend=0.0, kind=MOVEJ):
        scaled = [round(v * SCALE) for v in (*q, *(0.0,) * 12, duration, blend)]
        self.trajectory.sendall(struct.pack(">21i", *scaled, kind))

    def result(self):
        return struct.unpack(">i", receive_exactly(self.trajectory, 4))[0]

    def tell(self, number, *values):
        """Send a script command: numbers as they are."""
        self.command.sendall(struct.pack(">28i", number, *values, *(0,) * (27 - len(values))))

    def is_dropped(self):
        """Wait until the program has closed the reverse socket."""
        try:
            return self.reverse.recv(1) == b""
        except ConnectionResetError:
            return True
