"""The search for a cause that no likely bug is: which single change of refgi's own source gives what a port has.

A process of its own runs the first wrong stage as plain Python (`trial`), once for each change of an expression or
statement that it reaches (`edits`), and keeps the changes that explain the port's arrays in every case asked
(`changes`). Names of this package: an edit is one such change.
"""

from refgi.vectors.search.changes import searched

__all__ = ["searched"]
