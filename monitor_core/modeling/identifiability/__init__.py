"""Structural identifiability: which parameters the sensors can determine at all, from any record.

By the rank of the derivatives of the transfer function at random points.  The arithmetic is modulo a prime, so the rank
needs no tolerance, and combinations such as "kT/Jm" are recovered exactly.

* ``jacobian``: the derivatives of the Markov parameters C A^k B
* ``lattice``: small integer vectors from spaces modulo a prime
* ``combinations``: sums, products of powers and entries that are identifiable: "J1 + J2", "kT/Jm"
* ``structural``: the result, and the same in words
"""

from monitor_core.modeling.identifiability.structural import structural
