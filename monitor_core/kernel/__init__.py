"""The numeric kernel: one source of the arithmetic, compiled for one axis and for lanes of axes.

Every function takes ``lanes`` as its first argument.  For one axis it is the tuple ``(0,)``: its length is
part of its type, so Numba removes the loops over axes when it compiles this shape.  For many axes it is an array,
and the same loops become the inner, vectorised loops.  No function reassociates a sum, so both shapes give the
same bits.

The Taylor series alone (taylor_series, taylor_series_lanes) is written with vectors of LLVM (llvm_vectors).  With
plain loops in their place a sample cost 2.7 times as much for one axis and 6.5 times as much for each of 64 axes.

Read in this order: tables (a drive as arrays of indices and constants), state, admission (how a sample is used),
sample_interval (its real interval, delayed torque, mean speed), propagate and taylor_series (A, B, C at theta, and the
state over the interval), recursion (theta and P), supervision (P), cusum, evidence, block (all of it, in a loop over
samples).
"""
