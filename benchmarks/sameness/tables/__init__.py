"""What is varied, one table a method."""

from benchmarks.sameness.rows import Table
from benchmarks.sameness.tables import baselines, hssil, multires, sii, val

TABLES: dict[str, Table] = {"sii": sii.TABLE, "multires": multires.TABLE, "val": val.TABLE, "hssil": hssil.TABLE,
                            "temporal": hssil.TEMPORAL, **baselines.TABLES}
