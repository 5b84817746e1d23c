"""Provenance: what a file says of how it was made, and how to make it again.

Everything that refgi writes carries one record: the scene by name and by content, its camera and lights in full, the
method with all settings, what it was computed in, and which refgi did it.
"""

from refgi.provenance.again import Job, job_of, read_record
from refgi.provenance.record import (
    CONTENT,
    UNITS,
    Record,
    estimate_record,
    method_record,
    plain,
    program,
    scene_record,
    stated_record,
    versions,
)

__all__ = [
    "CONTENT", "UNITS", "Job", "Record", "estimate_record", "job_of", "method_record", "plain", "program",
    "read_record", "scene_record", "stated_record", "versions",
]
