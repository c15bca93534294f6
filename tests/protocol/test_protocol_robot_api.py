"""The table of the Robot API: which call a request is, what each software knows."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.robot_api import BASE, CALLS, api_version, calls_of, match_call
from protocol.ur_types import SoftwareVersion


def known(*version):
    return calls_of(SoftwareVersion(*version))


@pytest.mark.parametrize("call", CALLS, ids=lambda call: f"{call.method} {call.path}")
def test_every_call_is_found_with_and_without_a_slash_at_its_end(call):
    path = BASE + call.path.replace("{name}", "dance")
    argument = "dance" if "{" in call.path else ""
    assert match_call(call.method, path, CALLS) == (call, argument)
    assert match_call(call.method, path + "/", CALLS) == (call, argument)


def test_other_methods_and_paths_are_told_apart():
    assert match_call("GET", f"{BASE}/programs/v1/a%20b", CALLS)[1] == "a b"
    assert match_call("DELETE", f"{BASE}/program/v1/state", CALLS) == (None, "PUT, GET")
    assert match_call("GET", f"{BASE}/programs/v1/a/b", CALLS) == (None, "")
    assert match_call("GET", "/program/v1/state", CALLS) == (None, "")


def test_each_software_has_its_calls_and_its_version():
    assert match_call("PUT", f"{BASE}/program/v1/loaded", known(10, 11)) == (None, "")
    assert match_call("PUT", f"{BASE}/program/v1/loaded", known(10, 12))[0].since == (10, 12, 0, 0)
    versions = {11: "3.0.0", 12: "3.1.4", 13: "3.1.6", 14: "5.0.107"}
    assert {minor: api_version(SoftwareVersion(10, minor)) for minor in versions} == versions


def test_local_control_forbids_changes_but_for_files_of_programs():
    free = {(call.method, call.path) for call in CALLS if not call.needs_remote and call.method != "GET"}
    assert free == {("POST", "/programs/v1"), ("PUT", "/programs/v1")}


@given(st.text(max_size=40), st.sampled_from(["GET", "PUT", "PATCH", ""]))
def test_any_path_is_a_call_or_none(path, method):
    call, rest = match_call(method, f"{BASE}/{path}", CALLS)
    assert (call is None) or call.method == method
    assert isinstance(rest, str)
