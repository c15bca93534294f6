"""The feedback loop, without a robot: pure functions and small state, no sockets, no clock.

controller_config  the two named controllers and their numbers
reference          what the arm should do at any time, prepared for the loop
pi_feedforward     PI + velocity feed-forward for six joints (the paper's Fig. 3)
tracker            one frame in, one command out
stability          how much gain a loop with delay bears
excitation         the small movement that reveals the loop delay
delay              the loop delay from a logged stream
"""
