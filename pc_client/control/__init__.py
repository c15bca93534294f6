"""The feedback loop, without a robot: pure functions and small state, no sockets, no clock.

controller      the named controllers and their numbers, and those of a user's file
reference       what a run is made of, and what the arm should do at any time, prepared for the loop
loop            dead time, lag, integrator: what the client knows of the loop; its margins with feedback
identification  delay, or dead time and lag, from a small movement
tracker         one frame in, one command out: PI with feed-forward, guard of the tool; prediction of a run
gear            the waves of the gears from finished runs, and how to drive against them
learning        what one run of a movement teaches the next
"""
