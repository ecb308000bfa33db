"""From the drawing of a drive to x' = A(theta) x + B(theta) u, y = C(theta) x (paper, section 2).

drawing (components.py, drawing.py) or Modelica text (modelica/)
-> flat equations (flat.py)
-> elimination (elimination.py)  -> minimal state space, exact, in symbols (statespace.py)
-> monitor_core.model.Drive: the Laurent terms that the kernel takes (numbers.py)
"""
