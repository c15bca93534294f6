"""Movements of the TCP: human-like (three models), uniform (trapezoids) or given as samples.

A `Movement` gives position and velocity at any time in closed form. This package has no robot: no joints, no
limits, no sockets.

    trajectory                   what every model gives: position, velocity and acceleration at any time
    lognormal, sigma_lognormal   the paper's human-like model, from one lognormal to a movement
    uniform                      the paper's robot-like model: path, and speed profile
    minimum_jerk, power_law      two other models of human movement
    samples                      (x, y, z, t), poses or joint angles over time, as a table
    durations, variability       how long strokes last; the same movement another time
    movement, movement_file      the `Movement`, its constructors, its file
    library_sets, description    two sets of ten movements; the figures of a movement
    recipes, generate            the paper's recipe, into a workspace; every generator by a seed
"""
