"""How fast the traffic core is, measured in turn with other programs that simulate such traffic."""
