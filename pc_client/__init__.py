"""The PC side: plans human-like and robot-like movements and drives an arm along them, real or emulated.

Nothing in here can tell an emulator from a robot; only the address differs.
"""
