"""Tables of numbers from .csv, .parquet and .mat files, in blocks of rows.

* ``table_files``: reads a table of any of these formats, and writes some.
* ``csv_tables`` with ``table_head`` (the lines above the numbers) and ``table_cells`` (how a number or a time is
  written); ``long_tables``: one row for each time and each signal.
* ``torn_rows``: bad rows of a damaged table.  ``time_of_day``: times that begin again at midnight.
"""
