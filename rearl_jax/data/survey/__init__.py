"""Survey of an unknown file of recordings, and the command that reads it.

`sample` reads the first rows, `clock` and `motion` find who is where when and in which units, `proposal` takes columns
for canonical ones, `trial` reads the file that way, `report` says it.
"""
