"""Random programs with every kind of motion, alone and together; each goes round for ever and counts its rounds.

A statement lasts some seconds at most, so a program that plays and does not get on is stuck.
"""

import random
import re
from collections.abc import Sequence
from typing import Protocol

from urscript import ScriptError, compile_program
from urscript.catalogue import Catalogue

COUNTER = 0  # the output integer register that counts the rounds
KEPT_OUTPUT = 7  # the digital output that no program touches

_JOINT_LIMITS = "a={a}, v={v}"
_STREAM = "i = 0\nwhile i < {n}:\n  {call}\n  i = i + 1\nend"
_WRENCH = "force_mode(get_target_tcp_pose(), {axes}, [0,0,{f},0,0,0], {kind}, [0.1,0.1,0.1,0.3,0.3,0.3])"
_BELT = "encoder_enable_set_tick_count(0, 0)\ntrack_conveyor_linear(p[{x},{y},0,0,0,0], 1000, 0)"

# What a program may do in one of its rounds; words in braces are drawn anew for each.
STATEMENTS = {
    "movej": "movej({q}, {limits})",
    "movej in a time": "movej({q}, t={mt})",
    "movej chain": "movej({q}, {limits}, r=0.03)\nmovej({q}, {limits}, r=0.02)\nmovej({q}, {limits})",
    "movel": "movel({pose}, a={la}, v={lv})",
    "movel chain": "movel({pose}, a={la}, v={lv}, r=0.01)\nmovel({pose}, a={la}, v={lv}, r=0.01)\nmovel({pose}, v={lv})",
    "movep": "movep({pose}, a={la}, v={lv}, r=0.01)\nmovep({pose}, v={lv})",
    "movec": "movec({pose}, {pose}, a={la}, v={lv})",
    "servoc": "servoc({pose}, a={la}, v={lv})",
    "blend at the end": "movej({q}, {limits}, r=0.04)",
    "optimovej": "optimovej({q}, a=0.4, v=0.4)",
    "speedj stream": _STREAM.replace("{call}", "speedj({qd}, {a}, get_steptime())") + "\nstopj({a})",
    "speedj for a time": "speedj({qd}, {a}, {t})",
    "speedj until it is fast": "speedj({qd}, {a})",
    "speedj until it is fast, then a move": "speedj({qd}, {a})\nmovej({q}, {limits})",
    "speedl stream": _STREAM.replace("{call}", "speedl({xd}, {la}, get_steptime())") + "\nstopl({la})",
    "speedl until it is fast": "speedl({xd}, {la})",
    "servoj stream": "g = get_target_joint_positions()\n"
    + _STREAM.replace(
        "{call}", "g[5] = g[5] + {step}\n  servoj(g, t=get_steptime(), lookahead_time=0.1, gain=300)"
    )
    + "\nstopj({a})",
    "stopj": "speedj({qd}, {a}, {t})\nstopj({a})",
    "stopl": "speedl({xd}, {la}, {t})\nstopl({la})",
    "force mode and a move": _WRENCH + "\nmovel({pose}, v={lv})\nend_force_mode()",
    "force mode and a wait": _WRENCH + "\nsleep({t})\nend_force_mode()",
    "force mode and a stream": _WRENCH + "\nspeedj({qd}, {a})\nstopj({a})\nend_force_mode()",
    "force mode to the end": _WRENCH,
    "screw driving": "screw_driving(5, 0.02)\nsleep({t})\nend_screw_driving()",
    "freedrive": "freedrive_mode()\nsleep({t})\nend_freedrive_mode()",
    "freedrive and a move": "freedrive_mode()\nsleep({t})\nend_freedrive_mode()\nmovej({q}, {limits})",
    "freedrive and a stop": "teach_mode()\nsleep({t})\nend_teach_mode()\nstopj({a})",
    "freedrive and a stream": "freedrive_mode()\nsync()\nend_freedrive_mode()\nspeedj({qd}, {a})",
    "freedrive for no time": "freedrive_mode()\nend_freedrive_mode()\nmovel({pose}, v={lv})",
    "freedrive and force": "freedrive_mode()\nsleep({t})\n"
    + _WRENCH
    + "\nmovel({pose}, v={lv})\nend_force_mode()",
    "move in freedrive": "freedrive_mode()\nmovej({q}, t={mt})\nend_freedrive_mode()",
    "conveyor and a move": _BELT + "\nmovel({pose}, v={lv})\nstop_conveyor_tracking({a})",
    "conveyor and a stream": _BELT + "\nspeedl({xd}, {la})\nstop_conveyor_tracking({a})",
    "conveyor to the end": _BELT + "\nsleep({t})",
    "path offset": "path_offset_enable()\npath_offset_set([0, 0.01, 0.01, 0, 0, 0], 1)\nmovel({pose}, v={lv})\n"
    "path_offset_disable({a})",
    "torque": _STREAM.replace("{call}", "direct_torque([0,0,0,0,0,{f}])"),
    "torque and a move": _STREAM.replace("{call}", "direct_torque([0,0,0,0,0,0])") + "\nmovej({q}, {limits})",
    "thread that moves": "h = run mover()\nsleep({t})\nkill h\nstopj({a})",
    "thread that is waited for": "h = run one_move()\njoin h",
    "thread that is killed in a move": "h = run one_move()\nsleep(0.1)\nkill h\nmovej({q}, {limits})",
    "thread that streams": "h = run streamer()\nsleep({t})\nkill h",
    "popup": 'popup("walk", blocking=True)',
    "popup beside a move": 'h = run one_move()\npopup("walk", blocking=True)\njoin h',
    "popup that does not block": 'popup("beside", blocking=False)',
    "question": 'x = request_integer_from_primary_client("how many?")',
    "pause": "pause",
    "socket": 'socket_open("127.0.0.1", {port}, "w")\nsocket_send_line("hello", "w")\n'
    'socket_read_line("w", timeout={t})\nsocket_close("w")',
    "critical section": "enter_critical\nmovej({q}, t={mt})\nexit_critical",
    "sub-program": "walk_sub()",
    "tool": "set_tcp(p[0,0,{small},0,0,0])\nset_payload({small}, [0,0,0.02])",
    "zero": "zero_ftsensor()",
    "sleep": "sleep({t})",
    "work": "k = 0\nwhile k < 3000:\n  k = k + 1\nend",
    "interpreter mode": "interpreter_mode()",
    "protective stop": "protective_stop()",
}

_HEAD = """\
def {name}():
  set_tcp(p[0,0,0,0,0,0])
  global home = {home}
  global p0 = get_forward_kin(home)
  def walk_sub():
    movej({q}, {limits})
    speedj({qd}, {a}, 0.1)
  end
  thread one_move():
    movej({q}, {limits})
  end
  thread mover():
    while True:
      movej({q}, {limits}, r=0.02)
      movel({pose}, v={lv})
    end
  end
  thread streamer():
    while True:
      speedj({qd}, {a}, get_steptime())
    end
  end
  n = 0
  while True:
    n = n + 1
    write_output_integer_register({counter}, n)
    movej(home, a=2, v=1.5)
"""


class Draws(Protocol):
    """What draws numbers, as `random.Random` does."""

    def uniform(self, low: float, high: float, /) -> float: ...

    def randint(self, low: int, high: int, /) -> int: ...


class _Words:
    """Draws the words of the texts."""

    def __init__(self, rng: Draws, home: Sequence[float], port: str) -> None:
        self._rng, self._home, self._port = rng, home, port

    def __call__(self, match: re.Match[str]) -> str:
        rng = self._rng
        draw = rng.uniform
        match match[1]:
            case "q":
                return str([round(q + draw(-0.25, 0.25), 3) for q in self._home])
            case "qd":
                return str([round(draw(-0.7, 0.7), 3) for _ in range(6)])
            case "xd":
                return f"p[{', '.join(f'{draw(-0.08, 0.08):.3f}' for _ in range(6))}]"
            case "pose":
                return f"pose_add(p0, p[{', '.join(f'{draw(-0.05, 0.05):.3f}' for _ in range(6))}])"
            case "limits":
                return _JOINT_LIMITS.format(a=round(draw(0.8, 4.0), 2), v=round(draw(0.3, 2.0), 2))
            case "a":
                return f"{draw(0.8, 6.0):.2f}"
            case "la":
                return f"{draw(0.4, 2.0):.2f}"
            case "lv":
                return f"{draw(0.05, 0.4):.3f}"
            case "t":
                return f"{draw(0.05, 0.8):.2f}"
            case "mt":
                return f"{draw(0.6, 1.5):.2f}"
            case "f":
                return f"{draw(-8.0, 8.0):.1f}"
            case "x" | "y":
                return f"{draw(-1.0, 1.0):.2f}"
            case "step":
                return f"{draw(-0.004, 0.004):.4f}"
            case "small":
                return f"{draw(0.0, 0.08):.3f}"
            case "n":
                return str(rng.randint(2, 60))
            case "kind":
                return str(rng.randint(1, 3))
            case "axes":
                return str([rng.randint(0, 1) for _ in range(6)])
            case "port":
                return self._port
            case "home":
                return str(list(self._home))
            case "counter":
                return str(COUNTER)
        return match[0]


def statements_of(catalogue: Catalogue) -> list[str]:
    """Names of the statements that a version compiles."""
    names = []
    for name, text in STATEMENTS.items():
        filled = re.sub(
            r"\{(\w+)\}", _Words(_First(), (0.0,) * 6, "1"), _HEAD + _indented(text) + "  end\nend\n"
        )
        try:
            compile_program(filled.replace("{name}", "walk"), catalogue=catalogue)
        except ScriptError:
            continue
        names.append(name)
    return names


class _First:
    """Draws the least of everything."""

    def uniform(self, low: float, high: float, /) -> float:
        return low

    def randint(self, low: int, high: int, /) -> int:
        return low


def _indented(text: str) -> str:
    return "".join(f"    {line}\n" for line in text.splitlines())


def program(
    rng: random.Random, chosen: Sequence[str], home: Sequence[float], port: str, name: str = "walk"
) -> str:
    """The text of a program that does the chosen statements again and again."""
    text = _HEAD + "".join(map(_indented, (STATEMENTS[one] for one in chosen))) + "  end\nend\n"
    return re.sub(r"\{(\w+)\}", _Words(rng, home, port), text.replace("{name}", name))
