"""Programs and installations as files: where they lie, what they hold, which script they come to.

`ProgramFolder` finds them, `load_program` reads one. Nothing here runs a program or opens a socket.
"""
