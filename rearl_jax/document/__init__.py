"""What a task says: one document, shown in the terminal and as one HTML page, with its figures in Parquet beside it."""
