"""Conversion of foreign tables, in files or in memory, to canonical ones: column names, units and vehicle ids."""
