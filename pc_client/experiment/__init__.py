"""The experiment as a whole: which movements, how often, on which robot, into which folder.

    prepare         plan all movements and look at the folder, before anything moves
    preflight       the robot compared with the model, before anything moves
    experiment_text what a bystander must know and agree to, before a real arm moves
    approach_run    the slow approach to a start, streamed like everything that moves the arm
    identification  the loop of this session, and the margins on it
    prediction      what the loop makes of a plan, and the tolerances of a run
    repetitions     what runs of one movement hand on, and when it may be used
    command_check   the check of motions that no plan contains, before they are sent
    runner          approach, stream, record, for every movement and repetition
    observer        what the runner reports while it works
    progress        shows it on the terminal

It uses the driver only as a session; it opens no socket and reads no clock itself.
"""
