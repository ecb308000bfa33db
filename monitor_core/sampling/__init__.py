"""Compiled conversion of the frames of one axis to samples: time on the controller's clock, pairs of torque and motion.

Read in this order: clock_line (a line through times of receipt), controller_clocks (the state of a clock),
sample_counter and controller_cycle (the two kinds of it), pairing, stamp_meter, stream (the loop over frames that uses
all of these).
"""

from monitor_core.sampling.controller_cycle import cyclic_clock, cyclic_interval_s
from monitor_core.sampling.pairing import DROP_REASONS, new_pairing
from monitor_core.sampling.sample_counter import counted_interval_s, counter_clock, time_per_count_s
from monitor_core.sampling.stamp_meter import new_meter
from monitor_core.sampling.stream import (
    COUNTER,
    CYCLIC,
    FRAME,
    HAS_COUNT,
    HAS_MOTION,
    HAS_TORQUE,
    RECEIPT,
    Stream,
    compile_stream,
    flush_frames,
    new_samples,
    new_scratch,
    take_frames,
)
