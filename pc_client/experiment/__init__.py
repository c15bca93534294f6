"""The experiment as a whole: which movements, how often, on which robot, into which folder.

    experiment      what is to be done, in words for the people beside the arm, and its folder
    preflight       the robot compared with the model, before anything moves
    checks          what no plan contains, before it is sent: what the loop makes of a plan, what was learned
    identification  the loop of this session, and the margins on it
    repetitions     what runs of one movement hand on, and when it may be used
    runner          approach, stream, record, for every movement and repetition
    law_stream      a velocity law of a user on the arm

It uses the driver only as a session; it opens no socket and reads no clock itself.
"""
