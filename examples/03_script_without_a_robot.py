"""Compile URScript and run it on a host that only records: what a unit test of a script looks like."""

from urscript import RecordingHost, ScriptError, compile_program

PROGRAM = """def pick():
  global count = 0
  thread counter():
    while True:
      count = count + 1
      sync()
    end
  end
  run counter()
  movej([0, -1.57, 1.57, 0, 1.57, 0], a=1.2, v=0.5)
  textmsg("cycles: ", count)
end
"""

WRONG = """def pick():
  textmesg("hello")
end
"""


def main() -> None:
    host = RecordingHost()
    host.run(compile_program(PROGRAM), 1000)
    print("called:", *host.names_called())
    print("said:", *host.messages)
    try:
        compile_program(WRONG)
    except ScriptError as error:
        print(error.render())


if __name__ == "__main__":
    main()
