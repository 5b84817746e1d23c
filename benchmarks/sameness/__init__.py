"""A ledger of hashes of every method's irradiance, to prove that a change of the code changes no picture.

`python -m benchmarks.sameness --write FILE` records one hash a case, `--check FILE` computes all of them again and
prints those that differ. A case is one method with one setting changed, on one built-in scene, in one dtype; the
tables say which. Hashes hold for one machine: another CPU, or another version of Numba, may round otherwise.
"""
