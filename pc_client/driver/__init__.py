"""The only part of the client with sockets and a clock. A robot, an emulator and a test are alike to it.

transport        connections as a small interface: TCP here, memory in tests
watchdog         what a robot must report for the arm to move, and to go on moving
realtime         frames of port 30003, and waiting for something to show in them
primary          messages and states of ports 30001 and 30002; programs go out there
questions        single questions to the dashboard server and to RTDE
report           which robot answers, and what it reports of itself before it moves
receiver         the program that runs on the robot, and the port where it dials back
velocity_stream  the control loop: one frame in, one command out
session          a session with one robot: connect, stream, always stop
gripper          the fingers of a Robotiq gripper, and waiting for them
"""
