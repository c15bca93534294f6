"""The feedback loop, without a robot: pure functions and small state, no sockets, no clock.

controller         the named controllers and their numbers, and those of a user's file
reference          what the arm should do at any time, prepared for the loop
pi_feedforward     PI + velocity feed-forward for six joints (the paper's Fig. 3)
tracker            one frame in, one command out
tool_guard         ends a run when the tool leaves its path
excitation         the small movement that reveals the loop
delay              the loop delay from a logged stream
loop_model         dead time, lag, integrator: what the client knows of the loop, and its exact response
lag                dead time and lag apart, from a logged stream
stability          how much gain a loop with delay bears; margins
gear               the error of the gears from finished runs, and how to drive against it
gear_waves         the waves of one gear: their orders and sizes, found from the data
learning_filter    what part of an error is learned, and the proof that it converges
learning           what one run of a movement teaches the next
"""
