"""Motion: generators of joint targets, one control cycle at a time.

No module here knows physics, sockets, scripts or a clock.
"""
