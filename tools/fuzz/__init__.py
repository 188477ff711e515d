"""A fuzz harness: damaged and hostile inputs, and what must hold for every one of them.

Run ``python -m tools.fuzz --minutes 10``. An input is a command line with the files it reads (`case`). Each `kinds` module makes
inputs of one kind, number `i` of a seed always the same; `corpus` holds inputs that were faults once, and every run begins with
them. `observe` runs one input in this process and says what is wrong with the outcome (`checks`); `workers` shares the inputs
between processes and replaces one that dies or hangs; `shrink` makes a failing input small; `report` prints what was found.
"""
