"""A simulated robot: ``axis`` is one axis with a fault on request, ``robot`` all of them, in real time on a bus."""
