"""The client's model of the arm: nominal geometry, limits, kinematics, clearance.

The model is the published one (example-robot-data through Pinocchio), never the truth of a box
or of a calibrated arm: the difference between the two is part of what an experiment measures.

arms       one row an arm: geometry, limits, reach, working box; needs no Pinocchio
model      the arm in Pinocchio: forward, inverse, singularities, agreement with what a robot reports
cell       what stands around an arm and what it carries; cell files
tool       a gripper of the table as the tool of a cell
clearance  distances of the links from themselves, the floor and the cell
"""
