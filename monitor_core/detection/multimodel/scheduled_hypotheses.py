"""Nominal values that vary: hypotheses follow them in steps, as their predictors have fixed values in between."""

import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monitor_core.arrays import Floats
from monitor_core.drive.axis_model import AxisModel
from monitor_core.samples import forward_fill

FOLLOWED = 0.01
"""Of a parameter's scale: a step.  A hypothesis is then off by a tenth of the smallest size at most."""


def steps(
    model: AxisModel, shift: Floats | None, before: tuple[int, ...], N: int
) -> Iterator[tuple[slice, tuple[int, ...]]]:
    """Samples one after the other between which no nominal value moves, and by how many steps each has moved.

    Args:
        model: of the axis.
        shift: theta_0(s) - theta_0 (N, p), NaN where it is not known; None: as before.
        before: steps at the sample before.
        N: number of samples.
    """
    if shift is None:
        yield slice(0, N), before
        return
    moved = forward_fill(np.round(shift / (FOLLOWED * model.scale)), np.array(before, float)).astype(int)
    edges = [0, *(np.flatnonzero((np.diff(moved, axis=0) != 0).any(axis=1)) + 1).tolist(), N]
    for start, end in itertools.pairwise(edges):
        if start < end:
            yield slice(start, end), tuple(moved[start].tolist())


def moved_model(model: AxisModel, moved: tuple[int, ...]) -> AxisModel:
    """The model whose nominal values have moved by so many steps, within the bounds of theta; it monitors nothing."""
    if not any(moved):
        return model
    theta = model.theta0 + FOLLOWED * model.scale * np.array(moved)
    values = model.values(np.clip(theta, *model.limits))
    return replace(model, nominal=values, monitored=(), scales={}, bounds={}, relative=False)
