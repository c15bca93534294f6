"""The experiment as a whole: which movements, how often, on which robot, into which folder.

    experiment      what is to be done, in words for the people beside the arm, and its folder
    preflight       the robot compared with the model, before anything moves
    prediction      what no plan contains, before it is sent: what the loop makes of a plan, what was learned
    excitation      the loop of this session, and the margins on it
    run             identify; for every movement and repetition approach, stream, record, learn
    law_stream      a velocity law of a user on the arm

It uses the driver only as a session; it opens no socket and reads no clock itself.
"""
