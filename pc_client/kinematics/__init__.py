"""The client's model of the arm: nominal geometry, limits, kinematics, clearance.

The model is the published one (example-robot-data through Pinocchio), never the truth of a box
or of a calibrated arm: the difference between the two is part of what an experiment measures.
"""
