"""From frames of one axis to its samples: the time on the controller's clock, and pairs of torque and motion, compiled.

Read in this order: clock_line (a line through times of receipt), controller_clocks (a counter, or cycles), pairing,
stamp_meter, stream (all of it, in a loop over frames).
"""

from monitor_core.sampling.controller_clocks import (
    Clock,
    counted_interval_s,
    counter_clock,
    cyclic_clock,
    cyclic_interval_s,
)
from monitor_core.sampling.pairing import DROP_REASONS, Pairing, new_pairing
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
    new_scratch,
    room_for_samples,
    take_frames,
)
