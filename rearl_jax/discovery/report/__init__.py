"""Output of a discovery: verdict, tables, figures, page and repaired model."""
