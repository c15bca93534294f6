"""How programs come to the box: as text on a script port, from a file, from a PC by External Control."""
