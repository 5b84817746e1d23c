"""Run time against error: methods over a grid of settings, and the path tracer stopped early, on one scene or several.

`grid` says which settings; `measure` runs them in turn and judges them against path tracing, bias and variance apart;
`results` has the figures as data, JSON, CSV and Markdown; `pictures` writes EXR files, `views` reads them for the page,
`report`; `overview` looks at several scenes at once, `folder` at folders of results.
"""
