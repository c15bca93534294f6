"""The only part of the client with sockets and a clock; a robot, an emulator and a test are alike to it.

transport        connections as a tiny interface: TCP here, memory in tests
realtime_client  frames of port 30003: newest first, heartbeats, lost and late frames
package_stream   messages of ports 30001 and 30002: programs, errors, version
dashboard_query  questions to the dashboard server, port 29999
robot_info       which robot answers: firmware, serial number, simulated, real or not known
rtde_query       one value of the RTDE port
robot_report     what the robot reports of itself before it moves
condition        one thing that it must fulfil: what is, what must be, what to do
watchdog         what it must report for the arm to go on moving
receiver_script  the program that runs on the robot, filled in
stop_script      the program that stops the arm when the receiver does not
reverse_server   waits for the robot's program to dial back
velocity_stream  the control loop: one frame in, one command out
probe            what answers at an address, for `doctor`
ur_driver        a session with one robot: connect, stream, always stop
"""
