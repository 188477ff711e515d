"""Plays a case of `pidemu vectors` to a controller of your own, here the module my_controller: python play.py linear.csv."""

import csv
import math
import sys

from my_controller import INITIAL, scan

state = list(INITIAL)
with open(sys.argv[1], encoding="utf-8") as file:
    for n, row in enumerate(csv.DictReader(file)):
        cell = {name: float(text) if text else math.nan for name, text in row.items()}
        output = scan(state, cell["sp"], cell["pv"], cell["auto"], cell["manual"])
        if output != cell["output"]:
            sys.exit(f"{sys.argv[1]}: scan {n}: {output} instead of {cell['output']}")
print(f"{sys.argv[1]}: equal")
