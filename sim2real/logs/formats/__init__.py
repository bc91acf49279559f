"""Readers of the formats that logs come in: tables, MDF, MAT-files, and raw frames of a bus.

======================================  ===========================================================================
dialect.py, csv_file.py                 text tables: how one is written, and its cells
parquet_file.py, frame_table.py         Parquet, and tables in memory
kinds.py                                what a file is by its first bytes
extraction.py, extractor.py             readers that trust a file run in a process of their own
mdf_file.py, mdf_channels.py            MDF; formula.py evaluates its conversion formulas
mat_file.py, mat_variables.py           MATLAB's files
bus_file.py, bus_frames.py              raw frames of a bus; bus_signals.py and dbc.py say what they mean
======================================  ===========================================================================
"""
