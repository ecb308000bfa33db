"""From files and frames to samples of one axis in SI units, and proposals of what a file or a bus contains.

* On the bus: ``bus_samples`` (blocks of frames to samples) uses ``axis_input`` for each axis, with ``quantities``,
  ``unwrap``, ``late_values``, ``motion_derivatives``; ``encode`` and ``arm_motions`` are the inverse.
* From files: ``records`` (tables and CAN logs behind one interface), ``record_ranges`` (FILE@10:60),
  ``axis_records`` and ``loaded_records`` (the samples of one axis), ``table_files``, ``csv_tables``, ``long_tables``,
  ``table_head``, ``table_cells``, ``row_times``, ``torn_rows``, ``axis_columns`` (tables).
* The roles of columns and signals, for ``init`` and ``discover``: ``roles_by_name``, ``roles_by_values`` (with
  ``candidate_columns`` and ``column_values``) and, by these, ``column_roles`` (tables), ``signal_roles`` and
  ``live_roles`` (buses), ``drive_objects`` (CANopen), ``unknown_messages``.
* Remarks on a record: ``recorded_units``, ``timestamp_jitter``.
"""
