"""Conversion of foreign tables, in files or in memory, to canonical ones (see `data.schema`): names, units and ids."""
