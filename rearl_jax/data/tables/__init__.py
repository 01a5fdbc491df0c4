"""Foreign tables, in files or in memory, made canonical: columns named, units converted, ids numbered."""
