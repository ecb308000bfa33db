"""From records of an axis to its nominal values: `axiswatch identify`.

free.py       which parameters are to be found
beginning.py  the values to start from, if there are any
intervals.py  whether records are sampled as configured
varying.py    parameters that follow measured signals
task.py       the axis, its drive, and the records
masses.py     how many masses the records ask for
traces.py     what was measured, predicted and simulated, sample by sample
bode.py       frequency responses of the drive found, of a black box, and of the record itself
found.py      all that was found, for the reports
running.py    the whole way
"""
