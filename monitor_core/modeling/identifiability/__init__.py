"""Structural identifiability: the parameters that the sensors can determine in principle, from any record.

The method is the rank of the derivatives of the transfer function at random points.  The arithmetic is modulo a prime,
so the rank needs no tolerance, and combinations such as "kT/Jm" are recovered exactly.

* ``jacobian``: the derivatives of the Markov parameters C A^k B
* ``lattice``: small integer vectors from spaces modulo a prime
* ``combinations``: sums, products of powers and entries that are identifiable: "J1 + J2", "kT/Jm"
* ``structural``: the result, also in sentences
"""

from monitor_core.modeling.identifiability.structural import structural
