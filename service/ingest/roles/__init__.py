"""Finds which columns or signals are torque and motion of which axis, for ``init`` and ``discover``.

* By names and units: ``signal_roles`` (a bus with a description), with ``service.ingest.roles_by_name``.
* By values: ``roles_by_values``, with ``candidate_columns`` and ``column_values``.
* By both: ``column_roles`` (tables, with ``row_times``), ``live_roles`` (a bus that is listened to).
* Without a description: ``drive_objects`` (CANopen drives), ``unknown_messages``.
"""
