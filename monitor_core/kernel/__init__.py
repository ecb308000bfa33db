"""The numeric kernel: one source of the arithmetic, compiled for one axis and for lanes of axes.

Every function takes ``lanes`` as its first argument.  For one axis it is the tuple ``(0,)``: its length is
part of its type, so the loops over axes vanish when Numba compiles that shape.  For many axes it is an array,
and the same loops become the inner, vectorised ones.  No function reassociates a sum, so both shapes give the
same bits.

The Taylor series alone (series, series_of_eight) is written with vectors of LLVM (vector).  With plain loops in their
place a sample cost 2.7 times as much for one axis and 6.5 times as much for each of 64 axes.

Read in this order: tables (what a drive is here), state, laurent (A, B, C at theta), propagate and series (the
interval), delay and mean (intervals in parts), recursion (theta and P), cusum, admission (what becomes of a sample),
block (all of it, sample by sample).
"""
