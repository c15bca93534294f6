"""Builtins of the manual's module "interfaces": I/O, registers, sockets, remote procedures, Modbus."""

from __future__ import annotations

from .chapter import DRIVER_SCRIPT, FIELD_USE, MANUAL_E, MANUAL_LATE, MANUAL_X, POLYSCOPE_EXPORT, Chapter
from .types import Builtin, BuiltinArray, Param, ParamType, Support, TimeClass
from .versions import CB3_ONLY, EVERYWHERE, NOT_CB3, Generation, releases

_row = Chapter("interfaces").row

ANY, BOOL, INT, NUMBER, STRING = (
    ParamType.ANY,
    ParamType.BOOL,
    ParamType.INT,
    ParamType.NUMBER,
    ParamType.STRING,
)
LIST, VECTOR3 = ParamType.LIST, ParamType.VECTOR3
EXACT, APPROXIMATE = Support.EXACT, Support.APPROXIMATE
BLOCKING = TimeClass.BLOCKING


def _index(last: int, name: str = "n") -> Param:
    return Param(name, INT, unit=f"0 to {last}", low=0, high=last)


_ON = Param("b", BOOL)
_LEVEL = Param("f", NUMBER, unit="0 to 1 of the range")

_INPUTS_OUTPUTS: tuple[Builtin, ...] = (
    *(
        _row(name, params, returns, summary, support=EXACT, deprecated=deprecated)
        for name, params, returns, summary, deprecated in (
            ("get_standard_digital_in", (_index(7),), "bool", "a standard digital input", False),
            ("get_configurable_digital_in", (_index(7),), "bool", "a configurable digital input", False),
            ("get_tool_digital_in", (_index(1),), "bool", "a tool digital input", False),
            ("get_tool_digital_out", (_index(1),), "bool", "a tool digital output", False),
            ("get_standard_digital_out", (_index(7),), "bool", "a standard digital output", False),
            ("get_configurable_digital_out", (_index(7),), "bool", "a configurable digital output", False),
            ("set_standard_digital_out", (_index(7), _ON), "None", "switch a standard output", False),
            ("set_configurable_digital_out", (_index(7), _ON), "None", "switch a configurable output", False),
            ("set_tool_digital_out", (_index(1), _ON), "None", "switch a tool output", False),
            ("get_digital_in", (_index(9),), "bool", "0 to 7 standard, 8 and 9 tool", True),
            ("get_digital_out", (_index(9),), "bool", "0 to 7 standard, 8 and 9 tool", True),
            ("set_digital_out", (_index(9), _ON), "None", "0 to 7 standard, 8 and 9 tool", True),
            ("get_standard_analog_in", (_index(1),), "float, V or A", "a standard analogue input", False),
            ("get_tool_analog_in", (_index(1),), "float, V or A", "a tool analogue input", False),
            ("get_standard_analog_out", (_index(1),), "float, V or A", "a standard analogue output", False),
            ("set_standard_analog_out", (_index(1), _LEVEL), "None", "set a standard analogue output", False),
            ("get_analog_in", (_index(3),), "float, V or A", "0 and 1 standard, 2 and 3 tool", True),
            ("get_analog_out", (_index(1),), "float, V or A", "a standard analogue output", True),
            ("set_analog_out", (_index(1), _LEVEL), "None", "set a standard analogue output", True),
            ("get_flag", (_index(31),), "bool", "a flag kept between programs", False),
            ("set_flag", (_index(31), _ON), "None", "set a flag kept between programs", False),
        )
    ),
    _row(
        "set_analog_inputrange",
        (_index(3, "port"), Param("range", INT, unit="0 to 3, range code")),
        "None",
        "range of an analogue input",
        deprecated=True,
        support=EXACT,
    ),
    _row(
        "get_euromap_input",
        (Param("port_number", INT),),
        "bool",
        "a Euromap67 input",
        since=CB3_ONLY,
        support=APPROXIMATE,
        note="the signals are kept; no machine is connected",
    ),
    _row(
        "get_euromap_output",
        (Param("port_number", INT),),
        "bool",
        "a Euromap67 output",
        since=CB3_ONLY,
        support=APPROXIMATE,
        note="the signals are kept; no machine is connected",
    ),
    _row(
        "set_euromap_output",
        (Param("port_number", INT), Param("signal_value", BOOL)),
        "None",
        "switch a Euromap67 output",
        since=CB3_ONLY,
        support=APPROXIMATE,
        note="the signals are kept; no machine is connected",
    ),
    _row(
        "set_euromap_runstate_dependent_choice",
        (
            Param("port_number", INT),
            Param("runstate_choice", INT, unit="0 keep, 1 low, 2 high", low=0, high=2),
        ),
        "None",
        "what a Euromap67 output does when no program runs",
        since=CB3_ONLY,
        support=APPROXIMATE,
        note="the signals are kept; no machine is connected",
    ),
    _row(
        "set_tool_voltage",
        (Param("voltage", INT, unit="V", choices=(0, 12, 24)),),
        "None",
        "supply voltage of the tool",
        support=EXACT,
    ),
    _row(
        "set_tool_communication",
        (
            Param("enabled", BOOL),
            Param("baud_rate", INT, unit="9600 to 115200, 1M, 2M, 5M"),
            Param("parity", INT, unit="0 none, 1 odd, 2 even", low=0, high=2),
            Param("stop_bits", INT, unit="1 or 2", low=1, high=2),
            Param("rx_idle_chars", NUMBER, unit="1 to 40", low=1, high=40),
            Param("tx_idle_chars", NUMBER, unit="0 to 40", low=0, high=40),
        ),
        "None",
        "serial line of the tool connector",
        since=NOT_CB3,
        support=APPROXIMATE,
        note="checked and kept; the connector has no serial line here",
    ),
    _row(
        "set_tool_output_mode",
        (Param("mode", INT, unit="0 separate pins, 1 power", low=0, high=1),),
        "None",
        "how the tool outputs drive",
        since=NOT_CB3,
        support=APPROXIMATE,
        note="kept and reported; outputs have a level only",
        undocumented=(Generation.E_SERIES,),
        source=POLYSCOPE_EXPORT,
    ),
    _row(
        "set_tool_digital_output_mode",
        (_index(1), Param("mode", INT, unit="1 sinking, 2 sourcing, 3 push-pull", low=1, high=3)),
        "None",
        "how one tool output drives",
        since=NOT_CB3,
        support=APPROXIMATE,
        note="kept and reported; outputs have a level only",
        undocumented=(Generation.E_SERIES,),
        source=POLYSCOPE_EXPORT,
    ),
)

_BOOLEANS = _index(127, "address")
_NUMBERS = _index(47, "address")

_REGISTERS: tuple[Builtin, ...] = (
    *(
        _row(f"read_{side}_{kind}_register", (address,), returns, f"{side} register, {kind}", support=EXACT)
        for side in ("input", "output")
        for kind, address, returns in (
            ("boolean", _BOOLEANS, "bool"),
            ("integer", _NUMBERS, "int"),
            ("float", _NUMBERS, "float"),
        )
    ),
    _row(
        "write_output_boolean_register",
        (_BOOLEANS, Param("value", BOOL)),
        "None",
        "set an output register",
        support=EXACT,
    ),
    _row(
        "write_output_integer_register",
        (_NUMBERS, Param("value", NUMBER)),
        "None",
        "set an output register",
        support=EXACT,
    ),
    _row(
        "write_output_float_register",
        (_NUMBERS, Param("value", NUMBER)),
        "None",
        "set an output register",
        support=EXACT,
        nan_ok=True,
    ),
    _row(
        "read_port_bit",
        (Param("address", INT, low=0, high=65535),),
        "bool",
        "a bit of the Modbus server",
        support=EXACT,
    ),
    _row(
        "read_port_register",
        (Param("address", INT, low=0, high=65535),),
        "int",
        "a word of the Modbus server",
        support=EXACT,
    ),
    _row(
        "write_port_bit",
        (Param("address", INT, low=0, high=65535), Param("value", BOOL)),
        "None",
        "set a bit of the Modbus server",
        support=APPROXIMATE,
        note="what can only be read ignores writes",
    ),
    _row(
        "write_port_register",
        (
            Param("address", INT, low=0, high=65535),
            Param("value", INT, unit="16 bit", low=-32768, high=65535),
        ),
        "None",
        "set a word of the Modbus server",
        support=APPROXIMATE,
        note="what can only be read ignores writes",
    ),
    _row(
        "rtde_set_watchdog",
        (
            Param("variable_name", STRING),
            Param("min_frequency", NUMBER, unit="Hz", low=0),
            Param("action", STRING, "pause", "ignore, pause or stop"),
        ),
        "None",
        "pause or stop when an RTDE input is not refreshed often enough; cleared at program stop",
        support=APPROXIMATE,
        note="robot time; a paused program is not watched",
    ),
    _row(
        "get_rtde_value",
        (Param("key", STRING),),
        "value",
        "an RTDE output by name",
        support=APPROXIMATE,
        note="of the last cycle; outputs of later software too",
        since=releases(None, "5.24", "10.11"),
        source=MANUAL_LATE,
    ),
)


def _force_sensor(name: str, *, deprecated: bool) -> Builtin:
    return _row(
        name,
        (
            Param("enable", BOOL),
            Param("sensor_mass", NUMBER, 0.0, "kg"),
            Param("sensor_measuring_offset", VECTOR3, [0.0, 0.0, 0.0], "m"),
            Param("sensor_cog", VECTOR3, [0.0, 0.0, 0.0], "m"),
        ),
        "None",
        "take the wrench from an external sensor through RTDE",
        since=EVERYWHERE if deprecated else releases("3.14", "5.9", "10.0"),
        deprecated=deprecated,
        support=APPROXIMATE,
        note="the input is taken as the external wrench; no weight of the sensor is subtracted",
    )


_FORCE_SENSOR: tuple[Builtin, ...] = (
    _force_sensor("ft_rtde_input_enable", deprecated=False),
    _force_sensor("enable_external_ft_sensor", deprecated=True),
    _row(
        "zero_ftsensor",
        (),
        "None",
        "take the present wrench as zero",
        since=releases("3.14", "5.0", "10.0"),
        support=APPROXIMATE,
        note="the mean of 0.2 s; what a CB3 makes of it is not documented",
        undocumented=(Generation.CB3,),
        source=f"{MANUAL_E}, module interfaces; CB3: {DRIVER_SCRIPT}",
    ),
)

_SOCKET = Param("socket_name", STRING, "socket_0")
_TIMEOUT = Param("timeout", NUMBER, 2, "s; 0 or less waits for ever")
# Source: script manual, socket_read_ascii_float: at most 30 numbers in one call.
_HOW_MANY = Param("number", INT, unit="1 to 30", low=1, high=30)

_SOCKETS: tuple[Builtin, ...] = (
    _row(
        "socket_open",
        (Param("address", STRING), Param("port", INT, low=0, high=65535), _SOCKET),
        "bool",
        "connect to a TCP server; False after 2 s",
        time=BLOCKING,
        support=EXACT,
    ),
    _row("socket_close", (_SOCKET,), "None", "close the connection", support=EXACT),
    *(
        _row(
            name, (_HOW_MANY, _SOCKET, _TIMEOUT), "list of number + 1", summary, time=BLOCKING, support=EXACT
        )
        for name, summary in (
            ("socket_read_ascii_float", "numbers from a text (a,b,...); count first"),
            ("socket_read_binary_integer", "big-endian 32-bit integers; count first"),
            ("socket_read_byte_list", "bytes as integers; count first"),
        )
    ),
    _row(
        "socket_read_line",
        (_SOCKET, _TIMEOUT),
        "string",
        "text up to a line end",
        time=BLOCKING,
        support=EXACT,
        deprecated=True,
    ),
    _row(
        "socket_read_string",
        (
            _SOCKET,
            Param("prefix", STRING, ""),
            Param("suffix", STRING, ""),
            Param("interpret_escape", BOOL, False),
            _TIMEOUT,
        ),
        "string",
        "text between prefix and suffix, or all there is",
        time=BLOCKING,
        support=EXACT,
    ),
    _row(
        "socket_send_byte",
        (Param("value", NUMBER, low=0, high=255), _SOCKET),
        "bool",
        "send one byte",
        support=EXACT,
    ),
    _row(
        "socket_send_int",
        (Param("value", NUMBER), _SOCKET),
        "bool",
        "send a big-endian 32-bit integer",
        support=EXACT,
    ),
    _row(
        "socket_send_string", (Param("str", ANY), _SOCKET), "bool", "send a text", support=EXACT, nan_ok=True
    ),
    _row(
        "socket_send_line",
        (Param("str", ANY), _SOCKET),
        "bool",
        "send a text and a line end",
        support=EXACT,
        nan_ok=True,
    ),
    _row(
        "socket_set_var",
        (Param("name", STRING), Param("value", NUMBER), _SOCKET),
        "None",
        "send SET <name> <value> and a line end",
        support=EXACT,
    ),
    _row(
        "socket_get_var",
        (Param("name", STRING), _SOCKET),
        "int",
        "send GET <name> and read the answer; 0 after 2 s",
        time=BLOCKING,
        support=EXACT,
    ),
)

_SIGNAL = Param("signal_name", STRING)
_SECONDARY = Param("is_secondary_program", BOOL)
_SECONDARY_OPTIONAL = Param("is_secondary_program", BOOL, False)
_FIRST = releases("3.0", "5.0")
# Signals of several registers came with modbus_add_rw_signal, which needs lists of values (inferred).
_UNTIL_LISTS = releases(None, "5.15")
_SIGNALS_5_15 = releases(None, "5.15", "10.0")


def _add_signal(types: int, *later: Param) -> tuple[Param, ...]:
    return (
        Param("IP", STRING),
        Param("slave_number", INT, low=0, high=255),
        Param("signal_address", INT, low=0, high=65535),
        Param("signal_type", INT, unit="0 DI, 1 DO, 2 register in, 3 register out", low=0, high=types),
        _SIGNAL,
        Param("sequential_mode", BOOL, False),
        *later,
    )


_MODBUS: tuple[Builtin, ...] = (
    _row(
        "modbus_add_signal",
        _add_signal(3),
        "None",
        "supervise a signal of a Modbus server",
        since=_FIRST,
        until=_UNTIL_LISTS,
        support=APPROXIMATE,
        note="one connection a server; the IP may be a name and may have a :port",
    ),
    _row(
        "modbus_add_signal",
        _add_signal(16, Param("register_count", INT, 1, low=1, high=123)),
        "None",
        "supervise a signal of a Modbus server",
        since=_SIGNALS_5_15,
        source=MANUAL_LATE,
        support=APPROXIMATE,
        note="one connection a server; the IP may be a name and may have a :port",
    ),
    _row("modbus_delete_signal", (_SIGNAL,), "None", "forget a signal", support=EXACT),
    *(
        _row(
            name,
            # Exported programs read a signal with one argument. Source: files of 3.13.
            (_SIGNAL, *params, secondary if params else _SECONDARY_OPTIONAL),
            returns,
            summary,
            since=since,
            until=until,
            source=source,
            support=APPROXIMATE,
            note="a run-time error once no valid answer has come for 2 s",
        )
        for since, until, secondary, source, value, result in (
            (_FIRST, _UNTIL_LISTS, _SECONDARY, "", None, "bool or int"),
            (_SIGNALS_5_15, releases(), _SECONDARY_OPTIONAL, MANUAL_LATE, ANY, "value"),
        )
        for name, params, returns, summary in (
            ("modbus_get_signal_status", (), result, "last value of a signal"),
            (
                "modbus_set_output_register",
                (Param("register_value", value or INT),),
                "None",
                "write a register",
            ),
            (
                "modbus_set_output_signal",
                (Param("digital_value", value or BOOL),),
                "None",
                "switch an output",
            ),
        )
    ),
    _row(
        "modbus_set_signal_update_frequency",
        (_SIGNAL, Param("update_frequency", NUMBER, unit="Hz, 0 on demand", low=0, high=125)),
        "None",
        "how often a signal is refreshed",
        since=CB3_ONLY,
        support=EXACT,
    ),
    _row(
        "modbus_set_signal_update_frequency",
        (_SIGNAL, Param("update_frequency", NUMBER, unit="Hz, 0 or -1 acyclic", low=-1, high=500)),
        "None",
        "how often a signal is refreshed",
        since=NOT_CB3,
        support=EXACT,
    ),
    _row(
        "modbus_set_digital_input_action",
        (_SIGNAL, Param("action", STRING, choices=("default", "freedrive"))),
        "None",
        "what an input does beside being read",
        support=EXACT,
    ),
    _row(
        "modbus_send_custom_command",
        (
            Param("IP", STRING),
            Param("slave_number", INT, low=0, high=255),
            Param("function_code", INT, low=0, high=255),
            Param("data", LIST, unit="bytes"),
        ),
        "None",
        "send a request whose answer is not read",
        support=APPROXIMATE,
        note="lost when the server cannot be reached",
    ),
    *(
        _row(
            name,
            params,
            returns,
            summary,
            time=time,
            since=_SIGNALS_5_15,
            source=MANUAL_LATE,
            support=APPROXIMATE,
            note=note,
        )
        for name, params, returns, summary, time, note in (
            (
                "modbus_add_rw_signal",
                (
                    Param("IP", STRING),
                    Param("slave_number", INT, low=0, high=255),
                    Param("read_address", INT, low=0, high=65535),
                    Param("read_register_count", INT, low=1, high=123),
                    Param("write_address", INT, low=0, high=65535),
                    Param("write_register_count", INT, low=1, high=123),
                    _SIGNAL,
                    Param("sequential_mode", BOOL, False),
                ),
                "None",
                "supervise registers that are read and written in one request",
                TimeClass.ZERO,
                "what it reads and what it writes are kept apart; zeros for outputs that were never set",
            ),
            (
                "modbus_get_error",
                (_SIGNAL, Param("error_source", INT, 0, low=0, high=2)),
                "int",
                "error of a signal: 0 combined, 1 device, 2 connection",
                TimeClass.ZERO,
                "connection errors are -2 not connected and 110 no answer",
            ),
            (
                "modbus_get_time_since_signal_invalid",
                (_SIGNAL,),
                "float, s",
                "how long a signal has been in error",
                TimeClass.ZERO,
                "counted in robot time, in whole cycles",
            ),
            (
                "modbus_request_update_signal_value",
                (_SIGNAL,),
                "None",
                "refresh a signal now",
                TimeClass.ZERO,
                "done as soon as the unit can be reached",
            ),
            (
                "modbus_reset_connection",
                (Param("connection_id", STRING), Param("is_blocking", BOOL, True)),
                "None",
                "connect anew",
                BLOCKING,
                "waits for an answer to all signals of the unit",
            ),
            (
                "modbus_set_signal_watchdog",
                (_SIGNAL, Param("new_timeout_in_sec", NUMBER, low=0, high=300)),
                "None",
                "how long errors are tolerated",
                TimeClass.ZERO,
                "in real time",
            ),
        )
    ),
)

_TOPIC = (Param("topic", STRING), Param("type", STRING))
_QUALITY_OF_SERVICE = (
    Param("history", STRING, "default"),
    Param("depth", INT, 1),
    Param("reliability", STRING, "default"),
    Param("durability", STRING, "default"),
    Param("deadline", NUMBER, 0),
    Param("lifespan", NUMBER, 0),
    Param("liveliness", STRING, "default"),
    Param("lease_duration", NUMBER, 0),
)

_FACTORIES: tuple[Builtin, ...] = (
    _row(
        "rpc_factory",
        (Param("type", STRING, choices=("xmlrpc",)), Param("url", STRING)),
        "handle",
        "a handle whose methods are calls to an XML-RPC server",
        support=EXACT,
    ),
    *(
        _row(
            name,
            (Param("instance_name", STRING), Param("data_size", INT)),
            "handle",
            summary,
            since=releases(None, "5.16", "10.0"),
            source=f"{MANUAL_LATE}, chapter Flexible Ethernet/IP Adapter",
            note="this box has no EtherNet/IP adapter, so no scanner can exchange data with the handle",
        )
        for name, summary in (
            ("eip_writer_factory", "a handle that writes EtherNet/IP data"),
            ("eip_reader_factory", "a handle that reads EtherNet/IP data"),
        )
    ),
    *(
        _row(
            f"ros_{kind}_factory",
            (*_TOPIC, *_QUALITY_OF_SERVICE),
            "handle",
            f"a ROS 2 {words}",
            since=releases(None, None, "10.11"),
            source=MANUAL_X,
            note="this box has no ROS 2",
        )
        for kind, words in (
            ("publisher", "publisher"),
            ("subscriber", "subscriber"),
            ("service_client", "service client"),
            ("action_client", "action client"),
        )
    ),
)

ROWS: tuple[Builtin, ...] = _INPUTS_OUTPUTS + _REGISTERS + _FORCE_SENSOR + _SOCKETS + _MODBUS + _FACTORIES

ARRAYS: tuple[BuiltinArray, ...] = (
    BuiltinArray("digital_out", 10, "get_digital_out", "set_digital_out", FIELD_USE),
)
