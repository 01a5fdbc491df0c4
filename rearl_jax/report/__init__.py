"""A finished study as one HTML file: its result, its tables and figures, and its scenes replayed."""
