"""The papers' own figures and tables, made again and set beside the numbers that were printed.

Each paper is one folder whose `FIGURES` is the table of what is made: key, label, title, what the paper shows there,
and the function that makes it with scenes, settings and printed numbers. `runner.reproduce` makes figures one after
another, and one that fails leaves the others standing; it writes pictures, results.json and a page. Times are medians
of interleaved runs and are shown as ratios within the run: milliseconds of other machines are not comparable.
"""
