"""The front door: what a program that imports `pc_client` uses. The commands use it, too.

movement   `Movement`: a movement of the TCP, from points, files, samples or the library
arm        `connect`, `Arm`: a robot that was compared with its model; runs plans and velocity laws
confirmation  the question before an arm moves that is not known to be simulated
drawing    `drawing`: what a hand drew, for an arm
signals    `Signals`, `Run`: what the arm did, as arrays, as a table, as a figure
"""
