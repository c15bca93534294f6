"""Program files and installations: how they are found and read, and the script that they become.

`ProgramFolder` finds them, `load_program` reads one. Nothing here runs a program or opens a socket.
"""
