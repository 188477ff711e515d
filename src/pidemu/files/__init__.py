"""Where files enter and leave pidemu.

`reading` is the one place where text of a file comes in: size, encoding, control characters. `writing` is the one place where a
file goes out: written beside and renamed, never onto an input. `tables` has what records and tables share: rows, comments, cells
that a spreadsheet shall not take for formulas; `kinds` knows files that are no text. `cache` is the folder for what was compiled
once.
"""
