"""The configuration that ``axiswatch init`` proposes for the bus of a DBC, with what is to be checked in it."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from service.ingest.dbc_roles import DbcAxis, SignalRole

_INTERVAL_S = 0.005
