"""Scripts of program files, with installations of our own making."""

from dashboard_support import urp

from ur_emulator.program_files.folder import ProgramFolder
from ur_emulator.program_files.installation_reader import NEW_BOX
from ur_emulator.program_files.reader import ProgramReader
from ur_emulator.program_files.script_writer import Gap
from ur_emulator.program_files.urp_program import make_script


def made(folder, data, installation=NEW_BOX, name="sample.urp", **options):
    """Write a program file; return its script, as it is made for that installation."""
    (folder / name).write_bytes(data)
    reader = ProgramReader(ProgramFolder(folder))
    file = reader.folder.find(name)
    return make_script(reader.xml(file), reader, installation, **options)


def script_of(folder, data, installation=NEW_BOX, **options):
    """Return the script of a program file: no header, and a comment where the part of a PC belongs."""
    parts = made(folder, data, installation, **options).parts
    texts = (f"{part.indent}# gap" if isinstance(part, Gap) else part for part in parts)
    text = "\n".join(text for text in texts if isinstance(text, str))
    return text.encode("latin-1").decode()


def undefined_in(folder, nodes, installation=NEW_BOX):
    """Return what is undefined in the one node that is."""
    (text,) = made(folder, urp(nodes), installation).undefined
    return text


def lines_of(folder, nodes, installation=NEW_BOX, *, skip_unknown=False, **options):
    """Return the lines that nodes become, without indentation, behind the label of the program."""
    text = script_of(folder, urp(nodes, **options), installation, skip_unknown=skip_unknown)
    lines = [line.strip() for line in text.splitlines()]
    return lines[next(i for i, line in enumerate(lines) if line.endswith('"Robot Program"')) + 1 : -1]
