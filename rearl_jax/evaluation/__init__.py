"""The task `rearl evaluate`: simulated scenes compared with recorded ones in tables, figures and a page."""
