"""How far the sums of the tests go before they are back at zero."""

from monitor_core.arrays import Floats, Ints
from monitor_core.kernel.compile import entry


@entry
def excursions(
    d: Floats, nu: Floats, g: Floats, top: Floats, least: Floats, largest: Floats, found: Ints
) -> None:
    """For  g = max(0, g +/- d - nu)  the largest value of each excursion from zero that is above ``least`` (p,).

    It goes into a row of ``largest`` (2, p, capacity), ``found`` (2, p) counts them, also those for which there is no
    room.  d and nu are (N, p, W); ``g`` and ``top`` (2, p, W) are what a block before left.
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
