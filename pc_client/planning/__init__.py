"""From a movement of the TCP to a checked motion of the joints.

Everything here happens before the arm moves: what cannot be done safely is refused with a PlanningError that
names the sample, the point and the joint. No sockets, no clocks, no threads.
"""
