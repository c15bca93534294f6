"""What feeds the machine: sockets, clocks, threads and files; boxes and racks."""
