"""Reports for people and programs: of ``model``, ``excite``, ``identify``, ``calibrate``, ``commission``, ``replay``.

* ``*_report``: sentences and tables, for the terminal and for the page.  ``*_files``: TOML and JSON.
* ``*_html`` and ``*_plots``: the page, from ``templates/``, and its pictures.
* ``replay_result``, ``replay_course`` and ``timeline``: results that a replay collects while it runs.
* ``proposed_configuration``: the configuration that ``init`` and ``discover`` write.
* ``formats`` and ``plot_style``: shared by all of them.
"""
