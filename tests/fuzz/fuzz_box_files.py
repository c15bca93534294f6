"""What reads programs and installations in the box."""

from functools import cache

import fuzz_mutations as mutations
from dashboard_support import installation, urp
from fuzz_cases import Target
from test_dashboard_urp import SAMPLES as NODES

from ur_emulator.errors import ProgramFileError
from ur_emulator.models.cb3 import CB3
from ur_emulator.programs.compiling import load_and_compile
from ur_emulator.programs.folder import ProgramFolder
from ur_emulator.programs.installation import load_installation

_CATALOGUE = CB3.software(CB3.parse_version(CB3.default_version)).catalogue


@cache
def _programs():
    single = [urp(nodes) for nodes, _ in NODES.values()]
    return (
        *single,
        *(urp("".join(nodes for nodes, _ in NODES.values()), once=once) for once in (True, False)),
    )


def _in_folder(name, read):
    def read_content(data, folder):
        (folder / name).write_bytes(data)
        read(ProgramFolder(folder), name)

    return read_content


def _load_program(folder, name):
    load_and_compile(folder, name, _CATALOGUE)


BOX_FILES = {
    "program": Target(
        _programs, mutations.mutate_packed_xml, _in_folder("case.urp", _load_program), (ProgramFileError,)
    ),
    "installation": Target(
        lambda: (installation("10.1.2.3", "50010"),),
        mutations.mutate_packed_xml,
        _in_folder("case.installation", load_installation),
        (ProgramFileError,),
    ),
}
