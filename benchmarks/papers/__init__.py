"""The papers' own figures and tables, made again and set beside the numbers that were printed.

`catalogue.PAPERS` is the table of papers; each is one folder that lists its figures. `runner.reproduce` makes them one
after another, and one that fails leaves the others standing; `page` and `files` write what came of it. Times are
medians of interleaved runs and are shown as ratios within the run: milliseconds of other machines are not comparable.
"""
