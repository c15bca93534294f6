"""The box as a function of its inputs: no socket, no clock, no thread, no file; time is the tick."""
