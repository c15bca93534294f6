"""Goldens: what a box has sent, as hashes, to compare the code before and after a change that nobody may see.

    python tests/goldens/goldens.py record FOLDER     # with the code as it was
    python tests/goldens/goldens.py compare FOLDER    # with the code as it is; exit 1 and the names of what differs

Every chunk of the box's conformance corpus and every program of `tests/programs` runs in lockstep; in each cycle the frames,
states, data packages, messages and Modbus registers of all ports are hashed. The demo's recordings are hashed, too. The
hashes depend on the machine (its mathematical library), so they are recorded anew on each and kept nowhere.
"""

import hashlib
import json
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "ur_emulator")]

from chunk_bench import ChunkRun  # noqa: E402
from chunk_marks import load_box_chunks  # noqa: E402
from wire_story import MODBUS, Story  # noqa: E402

from pc_client.control.controller import CONTROLLERS  # noqa: E402
from pc_client.driver.session import UrDriver  # noqa: E402
from pc_client.experiment.experiment import Experiment  # noqa: E402
from pc_client.experiment.run import ExperimentRunner  # noqa: E402
from pc_client.kinematics.model import robot_model  # noqa: E402
from pc_client.movements.movement import load_motion  # noqa: E402
from pc_client.planning.plan import make_plan  # noqa: E402
from protocol.primary.messages import encode_message  # noqa: E402
from protocol.realtime.layout import layout_for_version  # noqa: E402
from protocol.rtde.fields import output_fields  # noqa: E402
from protocol.rtde.recipe import snapshot_encoder  # noqa: E402
from protocol.ur_types import SoftwareVersion  # noqa: E402
from ur_emulator import ControlBox  # noqa: E402
from ur_emulator.host.ports.primary.port import message_for  # noqa: E402
from ur_emulator.host.ports.primary.robot_state import StateEncoder  # noqa: E402
from ur_emulator.machine.controller.modbus_map import read_register  # noqa: E402
from ur_emulator.machine.models.generations import CB3  # noqa: E402
from urscript.check.checking import check_program  # noqa: E402

VERSION = SoftwareVersion(3, 15, 8)
CHUNKS = sorted((ROOT / "tests" / "ur_emulator" / "chunks").glob("*.script"))
DEMO = ("lognorm_4_1", "uniform_5_1")


class Bytes:
    """Hashes all that the ports of a box would send of a cycle."""

    def __init__(self, controller):
        self._hash = hashlib.sha256()
        self._controller = controller
        self._realtime = layout_for_version(VERSION).encoder()
        self._data = snapshot_encoder(tuple(output_fields(VERSION).values()), b"")
        self._states = StateEncoder(CB3.software(VERSION), controller.state.arm, controller.state.safety)
        self._hash.update(self._states.encode_first(controller.snapshot))

    def take(self, snapshot, events):
        self._hash.update(self._realtime(snapshot))
        self._hash.update(self._data(snapshot))
        self._hash.update(self._states.encode(snapshot))
        for address in MODBUS:
            self._hash.update(read_register(self._controller.state, address).to_bytes(2, "big"))
        for event in events:
            message = message_for(event, snapshot.tick)
            self._hash.update(repr(event).encode() if message is None else encode_message(message, VERSION))

    def digest(self):
        return self._hash.hexdigest()


class HashedRun(ChunkRun):
    """A chunk whose bytes are hashed."""

    def __init__(self, chunk):
        super().__init__(chunk)
        self.bytes = Bytes(self.bench.controller)

    def _tick(self, cycle, commands):
        first = len(self.bench.events)
        super()._tick(cycle, commands)
        self.bytes.take(self.bench.now, self.bench.events[first:])


def chunks():
    for chunk in load_box_chunks(*CHUNKS):
        run = HashedRun(chunk)
        if not check_program(chunk.text, catalogue=run.catalogue)[0]:
            run.start(chunk.text, chunk.actions)
            for program in chunk.then:
                run.start(program, [])
        yield f"chunk {chunk}", run.bytes.digest()


def story():
    told = Story()
    taken = Bytes(told.controller)
    for snapshot in told.snapshots:
        taken.take(snapshot, ())
    yield "story", taken.digest()


def demo():
    for controller in ("paper", "preview", "best"):
        with (
            tempfile.TemporaryDirectory() as folder,
            ControlBox(pace="lockstep", seed=7, port_base=None) as box,
        ):
            model = robot_model("ur3")
            plans = tuple(make_plan(load_motion(name), model) for name in DEMO)
            experiment = Experiment(model, plans, 2, Path(folder))
            with UrDriver(box.host, box.ports) as driver:
                ExperimentRunner(driver, experiment, CONTROLLERS[controller]).run()
            for path in sorted(Path(folder).glob("*.mcap")):
                yield f"demo {controller} {path.name}", hashlib.sha256(path.read_bytes()).hexdigest()


def main(what, folder):
    file = Path(folder) / "goldens.json"
    found = {name: digest for part in (chunks, story, demo) for name, digest in part()}
    if what == "record":
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(found, indent=1) + "\n")
        print(f"{len(found)} goldens written to {file}")
        return 0
    before = json.loads(file.read_text())
    differ = sorted(name for name in before.keys() | found.keys() if before.get(name) != found.get(name))
    print(*differ, f"{len(differ)} of {len(before)} goldens differ", sep="\n")
    return 1 if differ else 0


if __name__ == "__main__":
    if len(sys.argv) != 3 or sys.argv[1] not in ("record", "compare"):
        sys.exit("usage: goldens.py record|compare FOLDER")
    sys.exit(main(*sys.argv[1:]))
