"""Batches: scenes x methods x settings x frames as jobs whose results are files named by what they depend on.

`plan` reads what is run, `jobs` names every job by its content and `code` by the sources that it reaches; `work` does
jobs on buffers and truths that they share (`shared`), `schedule` in this process or in several, `cluster` on several
machines; `results` puts their files together, `temporal`, `thresholds` and `baseline` judge them.
"""
