"""What the joints are asked to do: pure generators of joint targets, one cycle at a time.

Nothing here knows physics, sockets, scripts or a clock.
"""
