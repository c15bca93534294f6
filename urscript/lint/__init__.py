"""What is allowed but probably not meant: the warnings of `urscript check`."""
