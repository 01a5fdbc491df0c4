"""Survey of an unknown file of recordings, which prints the command that reads the file.

`sample` reads the first rows, `clock` and `motion` find the columns of vehicles, times, positions and speeds and their
units, `proposal` assigns columns to canonical ones, `trial` reads the file with this assignment, `report` prints it.
"""
