"""Implementation of the commands of `urscript`, mainly `urscript run`."""
