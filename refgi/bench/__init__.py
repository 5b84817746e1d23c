"""Run time against error: methods over a grid of settings, and the path tracer stopped early, on one scene or several.

`grid` says which settings; `measure` runs them in turn and judges them against path tracing, bias and variance apart;
`results` has the figures as data, JSON, CSV and Markdown; `pictures` writes EXR files and reads them for the page of
`report`; `folder` looks at folders of results. `choose` goes along tracks of settings (`grid`) for the cheapest that
meets a wish; `split` tells what the error of a method is made of, by the approximations that it declares; `skips` and
`trades` tell what a scene does not need.
"""
