"""Sweeps: many cells of one study in one program."""
