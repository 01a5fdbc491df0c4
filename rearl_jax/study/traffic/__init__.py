"""REARL on a better traffic model: how much is left for decisions to do, as rows of `rearl study table1`."""
