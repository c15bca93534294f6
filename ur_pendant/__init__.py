"""The window: an emulated box, a real arm or a recording in the browser, by viser.

It is a process of its own, and a client like others: a box has no line for it. A robot that does not say that
it is simulated is only shown (`Robot.refusal`).
"""
