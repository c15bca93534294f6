"""Tree to text in the canonical layout, comments kept: `urscript fmt`."""
