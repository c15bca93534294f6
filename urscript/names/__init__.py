"""Which variable and which function each name of a program means, before it runs."""
