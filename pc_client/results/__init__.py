"""How results are shown and written, whatever they are results of."""
