"""Nodes of program files of our own making, in the forms that PolyScope gives them: helpers, and the samples of a file."""

import gzip
import re
from pathlib import Path
from typing import NamedTuple

from dashboard_support import expression, expression_chars, urp

JOINTS = "0.1, -1.5, 1.2, -1.0, -1.5, 0.0"
POSE = "0.25, -0.1, 0.3, 0.0, 3.0, 0.5"
POSE_TEXT = "p[.250000000000, -.100000000000, .300000000000, .000000000000, 3.000000000000, .500000000000]"
BASE = '<feature class="GeomFeatureReference" referencedName="Joint_0_name"/>'
TOOL = '<feature class="GeomFeatureReference" referencedName="Joint_6_name"/>'
POSITION = f'<position joints="{JOINTS}" pose="{POSE}"/>'
ANGLES = f'<position><JointAngles angles="{JOINTS}"/></position>'
FASTER = '<motionParameters jointSpeed="2.0" jointAcceleration="3.0" cartesianSpeed="0.5" cartesianAcceleration="1.5"'


def move(kind, nodes, attributes='useActiveTCP="true"', feature=BASE):
    return f'<Move motionType="{kind}" speed="0.25" acceleration="1.2" {attributes}>{feature}<children>{nodes}</children></Move>'


def waypoint(name="W", inside=f"<motionParameters/>{POSITION}", kind="Fixed"):
    return f'<Waypoint type="{kind}" name="{name}" kinematicsFlags="4">{inside}</Waypoint>'


def variable_waypoint(name):
    return f'<Waypoint type="Variable" name="Waypoint" kinematicsFlags="1"><motionParameters/><variable name="{name}"/></Waypoint>'


def pin(name):
    return f'<pin referencedName="{name}"/>'


def assignment(name, text):
    return f'<Assignment valueSource="Expression"><variable name="{name}"/>{expression(text)}</Assignment>'


def branch(kind, nodes="", condition="", *, watched=False):
    inside = expression(condition) if condition else "<expression/>"
    return f'<If type="{kind}" checkContinuously="{str(watched).lower()}">{inside}<children>{nodes}</children></If>'


def direction(untils, attributes='selectedDirection="ZMinus" toolParams="0.1, 0.8"', inside=""):
    tag = "gui.program.direction.MoveDirectionNode"
    return f"<{tag} {attributes}>{inside}<children>{untils}</children></{tag}>"


def until_distance(distance, nodes=""):
    return (
        f'<Until type="DISTANCE" deceleration="1.2" distanceNodeType="STOP" allowActions="{str(bool(nodes)).lower()}">'
        f'<Distance>{distance}</Distance><motionParameters blendRadius="0.0"/><children>{nodes}</children></Until>'
    )


CONTACT = '<Until type="TOOL_CONTACT_DETECTION" retraction="0.02" decelerationAcceleration="3.0" allowActions="false"/>'
HALT = "<Halt/>"


class Sample(NamedTuple):
    """Nodes, the lines of their script, and what is special about the program."""

    nodes: str
    script: str
    words: frozenset[str]

    def file(self):
        """Return the program file."""
        if "file" in self.words:
            return gzip.compress(self.nodes.encode(), mtime=0)
        return urp(self.nodes, saved_in=NEW if "e-series" in self.words else OLD)


def _read(text):
    for block in re.split(r"^== ", text, flags=re.MULTILINE)[1:]:
        head, nodes, script = re.fullmatch(r"([^\n]*)\n(.*?)\n--\n(.*)", block, re.DOTALL).groups()
        name, *words = re.split(r" \[(?=[^\]]*\])", head)
        nodes = re.sub("«(.*?)»", lambda match: expression_chars(match[1]), nodes)
        yield name, Sample(nodes, script.strip("\n"), frozenset(word.rstrip("]") for word in words))


OLD, NEW = "3.15.8.106339", "5.11.1.108318"
SAMPLES = dict(_read((Path(__file__).parent / "urp_nodes.txt").read_text()))
