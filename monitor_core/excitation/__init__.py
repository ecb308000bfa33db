"""Excitation signals, and experiments designed with them.

* ``multisine_signals``: signals.  ``design``: an experiment within the limits of a drive, simulated by
  ``planned_drive`` and ``motions``.
* ``accuracy``: the Cramer-Rao bound of a record.  ``prediction``: the bound of a planned record.
* ``reference_experiment``: the experiment of the paper.
"""

from monitor_core.excitation.accuracy import Accuracy
from monitor_core.excitation.design import Command, ExcitationTask, PlannedExperiment, plan, warnings
from monitor_core.excitation.motions import ExcitationError, MotionLimits
from monitor_core.excitation.multisine_signals import crest_factor, multisine
from monitor_core.excitation.planned_drive import Plant
from monitor_core.excitation.prediction import Estimation
from monitor_core.excitation.reference_experiment import experiment, faulty
