"""The slow course of the parameters, over weeks and months: what it was, whether it drifts, when it reaches a limit.

``entries`` are means over hours of operation, of which ``slow`` keeps a year; ``noise`` says how they scatter about any
course, ``trend`` which course explains them, ``forecast`` when it crosses a limit, ``watch`` when that is worth a word.
"""
