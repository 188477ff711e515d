"""A whole plant: its loop list in, converted settings out, every line accounted for.

The way of a line: a reader (`sources`) makes sheets of text cells of a file; `layout` finds header and columns; `lines` tells
loops from headings; `reading` makes settings of a loop's cells (units in `settings_units`, numbers on `dials`), and findings of
what cannot or must not be read; `converting` asks `pidemu.convert`; `job` does so for all and counts; `document`, `columns`,
`workbook_file` and `exceptions` write it down.

`l5x/` reads Rockwell exports, which state their loops without columns.
"""
