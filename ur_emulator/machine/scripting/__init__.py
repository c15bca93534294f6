"""A running URScript program on this box: what its builtins do to the controller. No sockets, no clock."""
