"""A dashboard client, program files, and a PC that External Control asks."""

import gzip
import socket
import threading
import time
from contextlib import contextmanager

from box_support import TIMEOUT, connect

GREETING = "Connected: Universal Robots Dashboard Server"
WAIT_NODE = '<Wait type="Sleep"><waitTime>0.01</waitTime></Wait>'


class Dashboard:
    """A dashboard client: sends lines, reads one reply for each."""

    def __init__(self, box):
        self.sock = connect(box, "dashboard")
        self.lines = self.sock.makefile("rb")
        try:
            assert self.reply() == GREETING
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.lines.close()
        self.sock.close()

    def send(self, *lines):
        self.sock.sendall(b"".join(line.encode("latin-1") + b"\n" for line in lines))

    def reply(self):
        line = self.lines.readline()
        assert line.endswith(b"\n"), line
        assert b"\r" not in line
        return line[:-1].decode("latin-1")

    def ask(self, line):
        self.send(line)
        return self.reply()

    def ask_all(self, *lines):
        """Send all lines in one write; return the replies."""
        self.send(*lines)
        return [self.reply() for _ in lines]

    def until(self, line, wanted):
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            if self.ask(line) == wanted:
                return
        raise AssertionError(f"{line!r} never answered {wanted!r}, but {self.ask(line)!r}")

    def is_closed(self):
        try:
            return self.lines.readline() == b""
        except ConnectionResetError:
            return True


def expression_chars(text):
    """A text in an expression, as PolyScope keeps it: one element a character."""
    quote = {"&": "&amp;", '"': "&quot;", "<": "&lt;"}
    return "".join(f'<ExpressionChar character="{quote.get(c, c)}"/>' for c in text)


def expression(text):
    """An expression that is a text."""
    return f"<expression>{expression_chars(text)}</expression>"


def script_line(text):
    """A node with one line of script."""
    return f'<Script type="Line">{expression(text)}</Script>'


def urp(
    nodes,
    *,
    once=True,
    installation="default",
    around="",
    packed=True,
    name="sample",
    saved_in="3.15.8.106339",
    first="",
):
    """A program file of our own making, in the form that PolyScope gives its files.

    Args:
        nodes: of the main program.
        once: it does not loop.
        installation: its name without suffix.
        around: nodes beside the main program.
        packed: with gzip, as PolyScope does it.
        name: of the program.
        saved_in: version of the software that saved it.
        first: what is in the node of first values; "" without one.
    """
    values = f"<InitVariablesNode>{first}</InitVariablesNode>" if first else ""
    text = (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<URProgram name="{name}" installation="{installation}" '
        f'installationRelativePath="{installation}" directory="/programs" createdIn="3.15.8.106339" '
        f'lastSavedIn="{saved_in}"><kinematics status="NOT_INITIALIZED" validChecksum="false"/>'
        f'<children>{values}{around}<MainProgram runOnlyOnce="{str(once).lower()}">'
        f"<children>{nodes}</children></MainProgram></children></URProgram>"
    )
    return gzip.compress(text.encode(), mtime=0) if packed else text.encode()


def installation(host="", port=""):
    """An installation file in which External Control has a PC."""
    data = f'<data key="host_ip" value="{host}"/><data key="port_nr" value="{port}"/>'
    text = f'<Installation><Contributed ownerId="com.fzi.externalcontrol">{data}</Contributed></Installation>'
    return gzip.compress(text.encode(), mtime=0)


def external_control(host="", port=""):
    """An External Control node; one that names no PC leaves that to the installation."""
    data = "".join(
        f'<data key="{key}" value="{value}"/>'
        for key, value in (("host_ip", host), ("port_nr", port))
        if value
    )
    return (
        '<Contributed strategyClass="com.fzi.externalcontrol.ExternalControlNode" '
        'strategyProgramNodeType="External Control" strategyURCapName="External Control">'
        f"<dataModel>{data}</dataModel></Contributed>"
    )


def write_programs(folder):
    """Some programs that most tests need."""
    (folder / "wait.urp").write_bytes(urp(WAIT_NODE, once=False))
    (folder / "hello.urp").write_bytes(urp(script_line('textmsg("hello")'), name="hello"))
    (folder / "strange.urp").write_bytes(urp("<PalletWizard/>"))
    (folder / "broken.script").write_text("def broken():\n  x = = 1\nend\n")
    (folder / "other.installation").write_bytes(installation("10.1.2.3", "50010"))
    (folder / "odd.installation").write_text("no installation")
    (folder / "cell").mkdir()
    (folder / "cell" / "count me.script").write_text(
        'i = 0\nwhile i < 3:\n  i = i + 1\nend\ntextmsg("counted ", i)\n'
    )
    return folder


@contextmanager
def pc_with_script(*programs, keep_open=False):
    """A PC that answers External Control with one program after the other; gives its port and what it was asked."""
    asked = []
    stop = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(TIMEOUT)

        def serve():
            kept = []
            for program in programs:
                try:
                    client, _ = server.accept()
                except OSError:
                    break
                asked.append(client.makefile("rb").readline())
                client.sendall(program.encode())
                kept.append(client)
                if not keep_open:
                    client.close()
            stop.wait(TIMEOUT)
            for client in kept:
                client.close()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield server.getsockname()[1], asked
        finally:
            stop.set()
            server.close()
            thread.join()


def gripper_node(kind, nodes="", **data):
    """A node of Robotiq's grippers; `nodes` are inside of it."""
    rows = "".join(f'<data key="{key}" value="{value}"/>' for key, value in data.items())
    return (
        f'<Contributed strategyProgramNodeType="{kind}" strategyURCapName="Robotiq_Grippers" '
        f'strategyURCapDeveloper="Robotiq Inc."><dataModel>{rows}</dataModel><children>{nodes}</children></Contributed>'
    )


def gripper_move(position, speed=100, force=20, **data):
    """A node that moves a gripper [%]."""
    values = {"position": position, "speed": speed, "force": force}
    doubles = {f"{key}InDouble": value for key, value in values.items()}
    whole = {key: int(value) for key, value in values.items()}
    return gripper_node("Gripper", **whole | doubles | data)
