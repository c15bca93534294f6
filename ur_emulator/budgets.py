"""What clients and programs may use of a box: the only table of these limits. SECURITY.md is made from it.

A budget bounds a client, a port, a program or the box as a whole. What comes on top of it is refused with one
line in the log, or gets slower itself; others do not notice it. Limits that belong to a wire format stay with
the format (`protocol`), limits of the language with the language (`urscript.dialect`).
"""

from dataclasses import dataclass, field
from typing import Any, Final

CYCLE: Final = 0.008
"""Time that the budgets of cycles are written for [s]: a control cycle has its part, see `of_cycle`."""
KIB: Final = 1 << 10
MIB: Final = 1 << 20


def of_cycle(limit: int, period_s: float) -> int:
    """Return the part of a budget for 8 ms that a control cycle of so many seconds has; at least 1."""
    return max(1, round(limit * period_s / CYCLE))


def _budget(limit: float, unit: str, scope: str, beyond: str) -> Any:
    """A budget of a client, a port, a program or a box; `beyond`: what happens to what comes on top."""
    return field(default=limit, metadata={"unit": unit, "scope": scope, "beyond": beyond})


def _cycle_budget(limit: float, unit: str, scope: str, beyond: str) -> Any:
    """A limit for 8 ms; those who keep it ask `of_cycle`."""
    return _budget(limit, unit, f"{scope}, 8 ms", beyond)


_REFUSED: Final = "it is closed at once"


@dataclass(frozen=True, slots=True)
class Budgets:
    """All budgets; a comment says where a figure comes from."""

    # --- clients and ports ---

    # A frame for a client costs 7 us, twice that on a slow host: 256 clients leave half of a cycle.
    clients: int = _budget(256, "clients", "a box", _REFUSED)
    clients_of_address: int = _budget(128, "clients", "an address", _REFUSED)
    clients_of_port: int = _budget(64, "clients", "an address at one port", _REFUSED)
    # A client costs up to 0.3 ms.
    accepted_at_once: int = _budget(2, "clients", "a turn of a port", "the next are accepted a turn later")
    # Two for each client that comes and goes; the log keeps an hour of programs beside a storm of clients.
    client_lines: int = _budget(200, "log lines a minute", "a box", "further ones are counted in one line")
    # A client that stops reading for half a second finds all it missed.
    outbox_bytes: int = _budget(64 * KIB, "bytes", "a client", "further packages to it are dropped")
    # 512 bytes of statements take 0.4 ms to be cut into programs.
    read_bytes: int = _budget(512, "bytes", "a turn of a client", "the rest is read in its next turn")
    # A unit is about 4 us: a turn takes a quarter of a millisecond, and never less than a whole request.
    client_work: int = _budget(64, "units of work", "a turn of a client", "the rest waits for its next turn")
    commands: int = _cycle_budget(256, "commands", "a box", "RTDE clients wait for the next cycle")

    # The public ur_rtde has 20 with 230 variables. 256 clients hold 20 MB with all they may have.
    rtde_recipes: int = _budget(64, "input recipes", "an RTDE client", "its names are answered NOT_FOUND")
    rtde_variables: int = _budget(
        1_000, "variables of input recipes", "an RTDE client", "the names are answered NOT_FOUND"
    )

    # --- control API ---

    scheduled_commands: int = _budget(1000, "operations", "wait for their time in a box", "it is refused")

    control_clients: int = _budget(32, "clients", "a control port", "the most silent one is closed")
    # 64 KiB of JSON take up to 1 ms to be read; the longest program in the field has 50 kB.
    body_bytes: int = _budget(64 * KIB, "bytes", "a body", "it is refused with status 413")
    # Programs of PolyScope X: 100 kB with a single node, 200 kB in the field.
    upload_bytes: int = _budget(MIB, "bytes", "a program for the Robot API", "it is refused with status 413")
    uploads_bytes: int = _budget(
        64 * MIB, "bytes", "all programs in the folder, 4 KiB each at least", "an upload is refused"
    )
    log_entries: int = _budget(100, "entries", "an answer of `log`", "they come with the next call")

    # --- scripts sent: text of unfinished programs and of those that wait for the compiler ---

    # The longest program, and 1 MiB behind it. A waiting program costs 2 KiB beside its text.
    script_bytes_client: int = _budget(5 * MIB, "bytes", "script of a client", "the newest is dropped")
    script_bytes: int = _budget(
        12 * MIB, "bytes", "script of a box", "the newest of a client that has more than 64 KiB is dropped"
    )
    script_bytes_gone: int = _budget(
        256 * KIB,
        "bytes",
        "script of clients that have gone",
        "the newest of the client with the most text is dropped; the longest of all is kept",
    )
    # More than any client sends; each costs the cycle up to 0.5 ms.
    programs_per_cycle: int = _cycle_budget(4, "programs", "started or refused", "the others wait")
    # Of any length: in lockstep, time may stand still between two scripts that are refused.
    script_warnings_per_cycle: int = _budget(4, "warnings about scripts", "a cycle", "no further ones")
    # A program with this much starts within 10 ms; 10,000 poses have room, or 3,300 waypoints of a .urp.
    program_functions: int = _budget(3_000, "functions", "a program", "it is refused")
    program_values: int = _budget(10_000, "global variables and poses", "a program", "it is refused")
    program_code: int = _budget(4 * MIB, "bytes", "a compiled program", "it is refused")

    # --- running programs ---

    # Units of `urscript.run.metering`, 50 ns: 2 ms of a cycle of 8 ms, 4 ms on a machine half as fast.
    # What is saved is for the thousands of assignments with which programs begin.
    program_units: int = _cycle_budget(
        30_000, "units", "the program of a box", "the program goes on in the next cycle"
    )
    program_units_saved: int = _cycle_budget(
        120_000, "units", "the program of a box after a rest", "the program goes on in the next cycle"
    )
    secondary_programs: int = _budget(
        32, "secondary programs", "a box, not ended yet", "the newest is not started"
    )
    secondary_units: int = _cycle_budget(
        10_000, "units", "all secondary programs of a box", "they go on in the next cycle"
    )
    secondary_units_saved: int = _cycle_budget(
        30_000, "units", "all secondary programs of a box after a rest", "they go on in the next cycle"
    )

    # --- variables and labels of running programs, as port 30001 reports them ---

    # A client that connects gets all names and values, encoded once a cycle: so many take 0.4 ms.
    variables_reported: int = _budget(2_000, "variables", "a program", "the others are not reported")
    # As many of 31 characters.
    variable_name_bytes: int = _budget(
        64 * KIB, "bytes", "all names of a program", "the others are not reported"
    )
    variable_bytes: int = _budget(256 * KIB, "bytes", "all values of a program", "the others go as none")
    # Updates come at 10 Hz. An element takes 2 µs.
    variables_per_update: int = _budget(500, "variables", "an update", "the others follow in the next one")
    variable_elements_per_update: int = _budget(
        1_000, "elements", "the changed values of an update", "the others follow in the next one"
    )

    # --- interpreter mode ---

    # A compatible box of another maker has this number.
    interpreter_lines: int = _budget(8_500, "lines", "interpreted since they were cleared", "it is discarded")
    # They go to the compiler with each line: 0.2 ms.
    interpreter_names: int = _budget(
        2_000, "functions and variables", "of interpreted lines", "the line is discarded"
    )
    interpreter_bytes: int = _budget(
        1 * MIB, "bytes", "lines of a box that are not interpreted yet", "it is discarded"
    )

    # --- sockets of scripts ---

    # All that a box dials: sockets and remote procedures of scripts, Modbus units, External Control.
    outgoing_connections: int = _budget(512, "connections", "a box", "`socket_open` returns False")
    # Source: RFC 1035.
    host_length: int = _budget(253, "characters", "the name of a host", "it is refused")
    # Threads that wait for a name server are given up by the system after half a minute.
    look_up_threads: int = _budget(8, "threads", "all boxes of a process", "names wait for their turn")
    look_ups_at_once: int = _budget(2, "names", "a box", "names wait for their turn")
    look_ups_waiting: int = _budget(64, "names", "a box", "`socket_open` returns False")
    # A line of the longest string has room. So many bytes take 2 ms to search, if they are made for it.
    inbox_bytes: int = _budget(
        128 * KIB,
        "bytes",
        "a socket of a script",
        "nothing more is read; a read that finds no end drops them",
    )
    unsent_bytes: int = _budget(256 * KIB, "bytes", "a socket of a script", "a send returns False")
    all_unsent_bytes: int = _budget(
        4 * MIB, "bytes", "all sockets of the scripts of a box", "a send returns False"
    )
    # They take 2 ms. This one is counted in real time, whatever the control cycle is.
    received_bytes: int = _cycle_budget(
        512 * KIB, "bytes", "all sockets of the scripts of a box", "the rest is read later"
    )
    # A read of a line looks at each byte once; a script that asks for more ends waits for the next cycle.
    search_bytes: int = _cycle_budget(
        128 * KIB, "bytes searched", "a program", "the read goes on in the next cycle"
    )
    remote_connections: int = _budget(
        16, "connections", "the remote procedure handles of a box", "the one that was idle longest is closed"
    )
    remote_answer_bytes: int = _budget(
        256 * KIB, "bytes", "an answer of a remote procedure", "the call fails"
    )
    remote_answer_time: float = _budget(
        30.0, "s from its first byte", "an answer of a remote procedure", "the call fails"
    )
    # 5,000 numbers take 10 ms, in pieces.
    remote_values: int = _budget(5_000, "values", "a call or an answer of a remote procedure", "it fails")
    remote_values_sent: int = _cycle_budget(
        5_000, "values", "all calls of remote procedures of a program", "the call waits"
    )
    external_control_time: float = _budget(
        30.0, "s", "a PC that sends a program", "a program is played that shows what is wrong"
    )
    modbus_links: int = _budget(
        320, "connections to Modbus units", "a box", "the oldest that no signal needs is closed"
    )
    modbus_requests: int = _budget(64, "requests that wait", "a Modbus unit", "the newest is lost")

    # --- files and reports ---

    # The largest programs in the field have some megabytes.
    program_bytes: int = _budget(16 * MIB, "bytes", "all files of a program, unpacked", "it is not loaded")
    # An element with an attribute takes 0.6 kB, and two of them.
    program_marks: int = _budget(300_000, "tags and attributes", "all files of a program", "it is not loaded")
    # Each level of nodes is two levels of XML.
    program_depth: int = _budget(200, "levels", "the elements of a file", "the program is not loaded")
    # Real programs nest a few levels.
    node_depth: int = _budget(50, "levels", "the nodes of a program", "it is not loaded")
    subprograms: int = _budget(200, "sub-programs", "a program", "it is not loaded")
    external_control_nodes: int = _budget(20, "nodes of External Control", "a program", "it is not loaded")
    # Real installations have up to a hundred of each.
    installation_entries: int = _budget(
        2_000, "TCPs, features, named lines, signals; variables", "an installation", "it is not loaded"
    )
    # The longest path that Linux takes; each part of one is looked up.
    path_length: int = _budget(4_096, "characters", "a path in the programs folder", "there is no such file")
    path_parts: int = _budget(64, "parts", "a path in the programs folder", "there is no such file")
    report_files: int = _budget(
        50,
        "flight reports and support files",
        "the programs folder",
        "no more are written until some are removed",
    )
    report_bytes: int = _budget(
        32 * MIB, "bytes", "all reports in the programs folder", "no more are written until some are removed"
    )
    folder_files: int = _budget(
        100_000, "files and folders", "a programs folder", "no reports and uploads are written into it"
    )

    # --- memory ---

    # Measured. A box that rests holds 90 MB, its worker processes share another 40.
    memory: int = _budget(
        160 * MIB,
        "bytes",
        "a process of boxes beyond what it holds at rest, with its worker processes",
        "the programs or the task that made it grow most end with an error",
    )

    # --- programs and files: compiling, loading and reports in the worker process ---

    # 3,000 lines take 0.3 s, 20,000 moves 4.5 s.
    task_seconds: float = _budget(10, "s of processor time", "a program, file or report", "it is refused")
    # 3,000 lines take 35 MiB.
    task_memory: int = _budget(96 * MIB, "bytes", "compiling, loading, reporting", "it is refused")
    task_result_bytes: int = _budget(16 * MIB, "bytes", "what was compiled or loaded", "it is refused")
    # Beyond it one that takes more than 1 s ends, and others take turns.
    long_tasks: int = _budget(1, "programs, files or reports", "that take more than 1 s", "they are refused")

    # --- journal and log ---

    # Two seconds of an e-Series box.
    journal_cycles: int = _budget(
        1_000, "cycles", "a journal that are not written yet", "the next are lost; lockstep waits"
    )

    # 300 kB of lines as they usually are.
    log_lines: int = _budget(
        3_000, "lines", "lines of --log that are not read", "the newest are lost, a line says how many"
    )


BUDGETS: Final = Budgets()
