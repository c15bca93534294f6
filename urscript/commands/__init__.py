"""What the commands of `urscript` do behind their options, above all `urscript run`."""
