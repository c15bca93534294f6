"""What a box dials: sockets, XML-RPC servers and Modbus units of running programs."""
