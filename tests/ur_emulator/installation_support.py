"""Installation files of our own making, in the forms that PolyScope 3.15 and 5.11 give theirs."""

import gzip
from math import pi, tau
from pathlib import Path

# As the file of an installation has them between <SafetySettings> and its end.
SAFETY = (Path(__file__).parent / "safety_settings.txt").read_text()
WIDE = 363.0 / 360.0 * tau

TCP = """<TCPSettings activePose="Gripper" toolPayload="1.25" centerOfGravity="0.0, 0.01, 0.05"><availablePoses>
<tcp id="a" name="TCP" offset="0.0, 0.0, 0.0, 0.0, 0.0, 0.0"/>
<tcp id="b" name="Gripper" offset="0.0, 0.0, 0.12, 0.0, 0.0, 0.5"/></availablePoses></TCPSettings>"""
NEW_PAYLOAD = """<PayloadSettings><Payload name="Empty" mass="0.0" defaultPayload="false" centerOfGravity="0.0, 0.0, 0.0"/>
<Payload name="Tool" mass="0.75" defaultPayload="true" centerOfGravity="0.0, 0.0, 0.04"/></PayloadSettings>"""
MOUNTING = f'<CameraView name="View"><worldTransform><WorldtoMarshal baseAngle="{pi / 4}" tiltAngle="{pi}"/></worldTransform></CameraView>'


def point(tag, position):
    return f'<{tag}><GeomPoseNode name="hidden"><toolPosition value="{position}"/><toolAxisAngle value="0, 0, 0"/></GeomPoseNode></{tag}>'


def pose_feature(name, pose, *, is_variable=False):
    position, rotation = ", ".join(map(str, pose[:3])), ", ".join(map(str, pose[3:]))
    return (
        f'<GeomPoseNode name="{name}" isVariable="{str(is_variable).lower()}" joggable="true"><jointPositionVector '
        f'value="NaN, NaN, NaN, NaN, NaN, NaN"/><toolPosition value="{position}"/><toolAxisAngle value="{rotation}"/></GeomPoseNode>'
    )


def plane_feature(name, points, *, has_points=False):
    tags = zip(("firstPoint", "secondPoint", "thirdPoint"), points, strict=True)
    inside = "".join(point(tag, ", ".join(map(str, place))) for tag, place in tags)
    return f'<GeomPlaneNode name="{name}" isVariable="false" userHasPoints="{str(has_points).lower()}">{inside}</GeomPlaneNode>'


def installation(*parts, packed=True):
    """An installation file of these parts."""
    text = f'<Installation directory="/programs" fileName="cell"><Version major="3" minor="15" bugfix="8"/>{"".join(parts)}</Installation>'
    return gzip.compress(text.encode(), mtime=0) if packed else text.encode()


def listed(tag, *values):
    return f'<{tag} value="{", ".join(map(str, values))}"/>'
