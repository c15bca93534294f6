"""The window: an emulated box, a real arm or a recording in the browser, by viser.

    robot.py        what a robot reports: RTDE, the primary port, the control API of a box
    hands.py        what people do to a box that is emulated
    drawing.py      arm, tool, surroundings and forces in space
    panel.py        controls and values beside them
    server.py       the page: whose it is, and who may open it
    recordings.py   recordings in place of a robot
    window.py       the process

It is a process of its own, and a client like others: a box has no line for it. A robot that does not say that
it is simulated is only shown (`Robot.is_held`).
"""
