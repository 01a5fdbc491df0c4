"""REARL on better traffic: how much is left for decisions to do, as rows of `rearl study table1`."""
