"""Batches: scenes x methods x settings x frames as jobs whose results are files named by what they depend on.

`plan` reads what is run, `jobs` names every job by its content and `code` by the sources that it reaches; `work` does
jobs on buffers and truths that they share (`shared`), `schedule` in this process, in several or on several machines;
`outcome` puts their files together and compares them with an earlier batch's, by thresholds that the plan holds.
"""
