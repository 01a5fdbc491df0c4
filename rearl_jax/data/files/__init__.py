"""Readers of file types: folders, text tables, Parquet columns, JSON documents."""
