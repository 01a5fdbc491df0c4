"""The document of a task, shown in the terminal and as one HTML page, with its figures in Parquet files."""
