"""What is on the wire between a Universal Robots control box and a PC, for both ends.

Tables of fields, codecs that interpret them, and sans-IO connections: bytes in, values out.
Nothing here opens a socket, starts a thread or reads a clock. Import the module you need.
"""
