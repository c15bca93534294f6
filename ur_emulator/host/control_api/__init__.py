"""The control API: a table of named operations on a box, how they are done, and how they are called."""
