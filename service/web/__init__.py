"""The web: REST API, metrics, event stream and dashboard, read from the newest snapshot, the journal and the history.

* ``app``: all routes and pages; ``app_state``: what they share; ``server``: uvicorn in its thread.
* ``gate``: every request first; ``access``: who may do what; ``problem_details``: every refusal.
* ``routes/``: one file for each part of the API.  ``views`` makes the bodies of ``models/`` from snapshots.
* ``metrics``: Prometheus, with ``metric_families`` (help texts) and ``metrics_text`` (format).  ``event_stream``:
  server-sent events.  ``history_json``, ``entity_tags``: long and repeated answers.  ``report_pages``, ``robot_setup``:
  what ``commission`` has written, and the configuration.
* ``dashboard/``: the page (TypeScript), built into ``static/``.
"""
