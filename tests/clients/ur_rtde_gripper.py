"""The gripper of ur_rtde, which its wheel has only in the library for C++, in a process of its own.

    python ur_rtde_gripper.py HOST PORT '[["connect", 2000], ["isActive"], ...]'

prints what each call returned as JSON, in a line after "=> ", among what the client itself prints. An exception of
the client ends the process.
"""

import ctypes
import importlib.metadata
import json
import sys
from ctypes import addressof, byref, c_bool, c_char_p, c_float, c_int, c_uint, c_void_p

_CLASS = "ur_rtde14RobotiqGripper"
# By name: symbol behind that of the class, arguments, result. The library has strings as before C++11.
_METHODS = {
    "connect": ("7connectEj", [c_uint], None),
    "disconnect": ("10disconnectEv", [], None),
    "isConnected": ("11isConnectedEv", [], c_bool),
    "activate": ("8activateEb", [c_bool], None),
    "autoCalibrate": ("13autoCalibrateEf", [c_float], None),
    "isActive": ("8isActiveEv", [], c_bool),
    "getOpenPosition": ("15getOpenPositionEv", [], c_float),
    "getClosedPosition": ("17getClosedPositionEv", [], c_float),
    "getCurrentPosition": ("18getCurrentPositionEv", [], c_float),
    "isOpen": ("6isOpenEv", [], c_bool),
    "isClosed": ("8isClosedEv", [], c_bool),
    "move": ("4moveEfffNS0_9eMoveModeE", [c_float, c_float, c_float, c_int], c_int),
    "open": ("4openEffNS0_9eMoveModeE", [c_float, c_float, c_int], c_int),
    "close": ("5closeEffNS0_9eMoveModeE", [c_float, c_float, c_int], c_int),
    "emergencyRelease": ("16emergencyReleaseENS0_10ePostionIdENS0_9eMoveModeE", [c_int, c_int], None),
    "faultStatus": ("11faultStatusEv", [], c_int),
    "setUnit": ("7setUnitENS0_14eMoveParameterENS0_5eUnitE", [c_int, c_int], None),
    "setPositionRange_mm": ("19setPositionRange_mmEi", [c_int], None),
    "setSpeed": ("8setSpeedEf", [c_float], c_float),
    "setForce": ("8setForceEf", [c_float], c_float),
    "objectDetectionStatus": ("21objectDetectionStatusEv", [], c_int),
    "waitForMotionComplete": ("21waitForMotionCompleteEv", [], c_int),
    "setVar": ("6setVarERKSsi", ["string", c_int], c_bool),
    "getVar": ("6getVarERKSs", ["string"], c_int),
    "setNativePositionRange": ("22setNativePositionRangeEii", [c_int, c_int], None),
}
_CONSTANT = ("isConnected", "getOpenPosition", "getClosedPosition")  # methods that promise to change nothing
_GET_VARS = "7getVarsERKSt6vectorISsSaISsEE"
_GET_RANGE = "22getNativePositionRangeERiS1_"


class RobotiqGripper:
    """The client; its methods have the names that they have there."""

    def __init__(self, host, port):
        self._library = ctypes.CDLL(str(importlib.metadata.distribution("ur_rtde").locate_file("librtde.so")))
        self._cpp = ctypes.CDLL("libstdc++.so.6")
        self._this = ctypes.create_string_buffer(8192)  # more than it takes
        self._call("C1ERKSsib", None, byref(self._string(host)), c_int(port), c_bool(True))

    def call(self, name, *arguments):
        if name == "getVars":
            return self._get_vars(arguments)
        if name == "getNativePositionRange":
            least, most = c_int(), c_int()
            self._call(_GET_RANGE, None, byref(least), byref(most))
            return [least.value, most.value]
        symbol, kinds, result = _METHODS[name]
        given = [
            byref(self._string(value)) if kind == "string" else kind(value)
            for kind, value in zip(kinds, arguments, strict=True)
        ]
        return self._call(symbol, result, *given, is_constant=name in _CONSTANT)

    def _get_vars(self, names):
        """A vector is three pointers: to its begin, its end, and the end of what it has; a string is one."""
        strings = (c_void_p * len(names))(*(self._string(name).value for name in names))
        end = addressof(strings) + ctypes.sizeof(strings)
        given, answer = (c_void_p * 3)(addressof(strings), end, end), (c_void_p * 3)()
        method = getattr(self._library, f"_ZN7{_CLASS}{_GET_VARS}")
        method.restype = None
        method(byref(answer), byref(self._this), byref(given))
        return list((c_int * ((answer[1] - answer[0]) // 4)).from_address(answer[0]))

    def _call(self, symbol, result, *arguments, is_constant=False):
        method = getattr(self._library, f"_ZN{'K' * is_constant}7{_CLASS}{symbol}")
        method.restype = result
        return method(byref(self._this), *arguments)

    def _string(self, text):
        string, allocator = c_void_p(), ctypes.c_char()
        self._cpp._ZNSsC1EPKcRKSaIcE(byref(string), c_char_p(text.encode()), byref(allocator))
        return string


if __name__ == "__main__":
    host, port, calls = sys.argv[1:]
    gripper = RobotiqGripper(host, int(port))
    for name, *arguments in json.loads(calls):
        print("=>", json.dumps(gripper.call(name, *arguments)), flush=True)
