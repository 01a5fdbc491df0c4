"""Groups of drivers: by a label, or by kinds that are found without one."""
