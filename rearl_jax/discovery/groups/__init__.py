"""Groups of drivers, by a label of the data or by clustering."""
