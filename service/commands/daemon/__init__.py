"""The daemon that ``run`` and ``demo`` start.

``lifecycle`` has ``run_daemon``, from its start to its end; ``daemon_parts`` opens and connects its parts, of which
``plant_links`` are those to the plant.  ``protection``: who may connect.  ``daemon_logs``: its log.
``service_manager``: what systemd is told.  ``alarm_replay``: the process that makes the report of an alarm.
"""
