"""Records of an axis from files, for replay, identification and calibration.

* ``record_files``: tables and CAN logs behind one interface.  ``record_ranges``: parts of them, as FILE@10:60.
* ``axis_records``: all samples of one axis of a file.  ``loaded_records``: with their origin, and as records of
  ``monitor_core.identification``.
* ``recorded_units``: the units of the signals as the files state them.
"""
