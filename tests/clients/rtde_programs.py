"""The robot's side of the maker's control loop over RTDE registers."""

WATCHDOG_PROGRAM = """def example():
  rtde_set_watchdog("input_int_register_0", 1, "PAUSE")
  global setp = p[0,0,0,0,0,0]
  thread copy():
    while True:
      local tmp = p[0,0,0,0,0,0]
      i = 0
      while i < 6:
        tmp[i] = read_input_float_register(i)
        i = i + 1
      end
      setp = tmp
      sync()
    end
  end
  h = run copy()
  write_output_integer_register(0, 1)
  while True:
    if (read_input_integer_register(0) == 1) and (setp != p[0,0,0,0,0,0]):
      movel(setp, a=3, v=0.5)
      write_output_integer_register(0, 0)
      while read_input_integer_register(0) == 1:
        sync()
      end
      write_output_integer_register(0, 1)
    end
    sync()
  end
end
"""
