"""What can be seen of a drive's parameters, whatever the record: by its structure and its sensors alone.

jacobian.py   the derivatives of the Markov parameters C A^k B, modulo a prime
lattice.py    small integer vectors from spaces modulo a prime
products.py   sums, products of powers and entries that can be seen: "J1 + J2", "kT/Jm"
naming.py     of these, enough to say all
structural.py the result
wording.py    what it says in words
"""

from monitor_core.modeling.identifiability.structural import Identifiability, structural

__all__ = ["Identifiability", "structural"]
