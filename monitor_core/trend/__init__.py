"""Long-term trend of a parameter over weeks and months: steady, drift or step, and when a limit is reached.

* ``entries``: readings of a monitor, and means of them over hours of operation.
* ``slow_history``: a year of entries in bounded memory.
* ``learning_window``: new nominal values of a repaired axis.
* ``trend_models``: the trends that are compared, and models of the scatter of the entries around them.
* ``trend``: the probabilities of the trends, level and slope.
* ``limit_forecast``: forecast of the time at which a limit is reached, with its interval.
"""

from monitor_core.trend.entries import EstimateReading, thinned
from monitor_core.trend.learning_window import PARTS, KeptReason, Learned, LearningWindow, WindowDoubt, WindowError
from monitor_core.trend.limit_forecast import forecast
from monitor_core.trend.slow_history import SlowHistory
from monitor_core.trend.trend import Trend, trend_of
