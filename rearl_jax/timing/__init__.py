"""Cost of compiled programs: CPU time, elapsed time and memory, measured in processes of their own and in turn."""
