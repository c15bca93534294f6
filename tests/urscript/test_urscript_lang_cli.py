import pytest
from typer.testing import CliRunner

from urscript.cli import app

GOOD = 'def good():\n  movej([0,0,0,0,0,0])\n  textmsg("gr\u00fc\u00dfe")\nend\n'
BAD = "def bad():\n  txtmsg(1)\n  y = nothing\nend\n"


@pytest.fixture
def call(tmp_path):
    def run(*words, **files):
        paths = []
        for name, text in files.items():
            path = tmp_path / f"{name}.script"
            path.write_text(text, encoding="utf-8")
            paths.append(str(path))
        return CliRunner().invoke(app, [*words, *paths])

    return run


def test_check_is_silent_about_good_programs(call):
    result = call("check", good=GOOD, crlf=GOOD.replace("\n", "\r\n"), bom="\ufeff" + GOOD)
    assert (result.exit_code, result.output) == (0, "")


def test_check_shows_all_errors_of_all_files(call):
    result = call("check", bad=BAD, good=GOOD, broken="def f(:\nend")
    assert result.exit_code == 1
    assert (
        "bad.script:2:3: Compile error: name 'txtmsg' is not defined (did you mean 'textmsg'?)"
        in result.output
    )
    assert "bad.script:3:7: Compile error: name 'nothing' is not defined" in result.output
    assert "broken.script:1:7: Syntax error" in result.output
    assert "      txtmsg(1)\n      ^^^^^^\n" in result.output


def test_check_shows_warnings_without_failing(call):
    result = call("check", warn="def p():\n  def f():\n  end\n  run f()\nend\n")
    assert result.exit_code == 0
    assert "4:3: Warning: 'f' is run as a thread" in result.output


def test_run_prints_texts_and_calls(call):
    result = call("run", "--robot", "none", good=GOOD)
    assert result.exit_code == 0
    assert "    0.000 s  good: movej([0, 0, 0, 0, 0, 0], 1.4, 1.05, 0, 0)\n" in result.output
    assert "gr\u00fc\u00dfe\n" in result.output


def test_run_quiet_prints_texts_only(call):
    assert call("run", "--quiet", good=GOOD).stdout == "gr\u00fc\u00dfe\n"


def test_run_reports_a_failing_program(call):
    result = call("run", bad="def p():\n  x = [1]\n  y = x[3]\nend\n")
    assert result.exit_code == 1
    assert "bad.script:3:7: Runtime error: index 3 is out of range; allowed: 0 to 0" in result.output


def test_run_stops_an_endless_program_at_the_limit(call):
    result = call("run", "--limit", "0.8", loop="while True:\n  sync()\nend\n")
    assert result.exit_code == 0
    assert "still running after 0.8 s" in result.output


@pytest.mark.parametrize(
    "words", [("check", "/nowhere.script"), ("run", "/nowhere.script"), ("run",), ("check",)]
)
def test_wrong_use_exits_with_2(call, words):
    assert call(*words).exit_code == 2


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
@pytest.mark.parametrize("command", ["check", "run", "fmt"])
def test_a_file_in_utf_16_is_refused_as_that(tmp_path, command, encoding):
    path = tmp_path / "windows.script"
    path.write_text(GOOD, encoding=encoding)
    result = CliRunner().invoke(app, [command, str(path)])
    assert result.exit_code == 2
    assert result.stderr == f"{path} is UTF-16 text: a controller reads UTF-8, save it as that\n"


def test_the_software_version_decides_which_names_exist(call):
    late = "set_target_payload(1, [0,0,0])\n"
    assert call("check", late=late).exit_code == 1
    assert call("check", "--software", "5.11", late=late).exit_code == 0
    assert call("check", "--software", "9.9", late=late).exit_code == 2


@pytest.mark.parametrize(
    ("software", "name", "hint"),
    [
        ("5.9", "set_target_payload", "known since e-Series 5.10, PolyScope X 10.0; this is e-Series 5.9"),
        ("3.15", "struct", "known since e-Series 5.14, PolyScope X 10.0; this is CB3 3.15"),
        ("5.17", "optimovej", "known since e-Series 5.21, PolyScope X 10.8; this is e-Series 5.17"),
        ("5.11", "set_euromap_output", "known since CB3 3.0; this is e-Series 5.11"),
        ("3.7", "str_cat", "known since CB3 3.8, e-Series 5.0, PolyScope X 10.0; this is CB3 3.7"),
    ],
)
def test_a_name_of_other_software_comes_with_its_first_releases(call, software, name, hint):
    result = call("check", "--software", software, other=f"def p():\n  {name}()\nend\n")
    assert f"other.script:2:3: Compile error: name '{name}' is not defined ({hint})" in result.output


def test_suggestions_fit_what_is_unknown(call):
    output = call(
        "check", hints="def p():\n  speed = 1\n  x = sped + force\n  movej_([0])\n  run moveit()\nend\n"
    ).output
    assert "name 'sped' is not defined (did you mean 'speed'?)" in output
    assert "name 'force' is not defined ('force' is a function, call it as force(...))" in output
    assert "name 'movej_' is not defined (did you mean 'movej'?)" in output
