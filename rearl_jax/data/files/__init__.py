"""Files as they lie on the disk: folders, text tables, Parquet columns, JSON documents."""
