"""Excursions of CUSUM sums from zero: their peaks and times."""

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry


@entry
def excursions(d: Floats, nu: Floats, g: Floats, top: Floats, least: Floats, largest: Floats, found: Ints) -> None:
    """Find the peak of each excursion from zero of  g = max(0, g +/- d - nu)  that is above ``least`` (p,).

    The peaks are appended to ``largest`` (2, p, capacity); ``found`` (2, p) counts them, including those beyond the
    capacity.  d and nu: (N, p, W).  ``g`` and ``top`` (2, p, W): state between blocks.
    """
    N, p, W = d.shape
    for k in range(N):
        for i in range(p):
            for a in range(W):
                for way in range(2):
                    g[way, i, a] += (d[k, i, a] if way == 0 else -d[k, i, a]) - nu[k, i, a]
                    if g[way, i, a] > 0.0:
                        top[way, i, a] = max(top[way, i, a], g[way, i, a])
                    else:
                        g[way, i, a] = 0.0
                        if top[way, i, a] > least[i]:
                            if found[way, i] < largest.shape[2]:
                                largest[way, i, found[way, i]] = top[way, i, a]
                            found[way, i] += 1
                        top[way, i, a] = 0.0


# --- Excursions of g of each hypothesis of a bank, with their times ---------------------------------------------------


START, PEAK, PLACE, ORIGIN = range(4)
"""Rows of times: first sample of an excursion; sample of its largest g; block of the record that this sample lies in;
block of the record that its innovation comes from."""


@entry
def excursion_peaks(
    g: Floats, clock: int, place: Ints, origin: Ints, least: Floats, top: Floats, now: Ints, largest: Floats,
    times: Ints, found: Ints
) -> None:  # fmt: skip
    """Append each excursion of g (N, H) that ends, and exceeded ``least`` (H,), to ``largest`` (H, capacity).

    ``clock``: time of the first sample, in samples.  ``place`` (N,): block of the motion of each sample.  ``origin``
    (N,): block of its innovation.  ``top`` (H,) and ``now`` (4, H): state of the open excursion between pieces.
    ``times`` (4, H, capacity) and ``found`` (H,): times and number of the excursions; the capacity must be N / 2.
    """
    N, H = g.shape
    for k in range(N):
        for i in range(H):
            if g[k, i] > 0.0:
                if top[i] == 0.0:
                    now[START, i] = clock + k
                if g[k, i] > top[i]:
                    top[i] = g[k, i]
                    now[PEAK, i] = clock + k
                    now[PLACE, i] = place[k]
                    now[ORIGIN, i] = origin[k]
            elif top[i] > 0.0:
                if top[i] > least[i]:
                    j = found[i]
                    largest[i, j] = top[i]
                    for row in range(4):
                        times[row, i, j] = now[row, i]
                    found[i] = j + 1
                top[i] = 0.0
