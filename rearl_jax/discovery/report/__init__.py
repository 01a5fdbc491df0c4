"""The verdict, with its tables, figures, page and repaired model."""
