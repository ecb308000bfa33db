"""From the drawing of a drive to x' = A(theta) x + B(theta) u, y = C(theta) x (paper, section 2).

    drawing in Python (drawing/) or Modelica texts (modelica/), both of components/
      -> flat equations (flat.py)
      -> elimination/ -> minimal state space, exact, in symbols (statespace.py), or in sympy's (symbolic.py)
      -> Drive: the Laurent terms that the kernel takes (numbers.py)

What can be told of the parameters: identifiability/ (at all), local.py (from a record).
"""
