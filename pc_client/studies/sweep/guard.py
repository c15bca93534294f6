"""The little program between a worker and the box it uses.

    python -m pc_client.studies.sweep.guard FOLDER COMMAND...

It starts the command and ends it when its own standard input ends, which is when the worker closes it or dies
by whatever cause, `kill -9` included. Then it takes the scratch folder away. When the command ends by itself,
its exit code is written into FOLDER/ended, and the folder stays until the worker has had a look.
"""

import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

ENDED_FILE = "ended"

_GRACE = 5.0
"""Time that the command gets to end when it is asked to [s]."""


def main(arguments: list[str]) -> None:
    """Run until standard input ends.

    Args:
        arguments: scratch folder, then the command and its arguments.
    """
    folder, command = Path(arguments[0]), arguments[1:]
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # asked to end: through the same door
    box = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    threading.Thread(target=_note_end, args=(box, folder), daemon=True).start()
    try:
        sys.stdin.buffer.read()
    except KeyboardInterrupt:
        pass
    finally:
        box.terminate()
        try:
            box.wait(_GRACE)
        except subprocess.TimeoutExpired:
            box.kill()
            box.wait()
        shutil.rmtree(folder, ignore_errors=True)


def _note_end(box: subprocess.Popen[bytes], folder: Path) -> None:
    """Write how the box ended, in one step, so that no reader gets half of it."""
    code = box.wait()
    partial = folder / f"{ENDED_FILE}.part"
    try:
        partial.write_text(str(code))
        partial.replace(folder / ENDED_FILE)
    except OSError:  # the folder is gone: there is no reader
        return


if __name__ == "__main__":
    main(sys.argv[1:])
