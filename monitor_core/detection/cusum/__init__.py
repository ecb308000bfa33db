"""From what the kernel notes to alarms that name what has changed, since when and by how much.

``episodes`` are the things themselves; ``evidence`` is what the kernel notes of a change, ``isolation`` says which
parameter explains it, ``onset`` and ``changes`` since when and how; the ``book`` keeps the open alarms of an axis.
"""
