"""One-line faults put into the sources, one at a time, to see which of them the tests notice.

`python -m benchmarks mutate` draws faults, puts each into a scratch copy and runs the tests that belong to the file. A
fault that no test notices is judged by pictures: where all of them stay as they are to the bit, the fault changes none.
"""
