"""Energy ledger: where the power of the lights goes under a method with pixel lights, in watts (REF-04)."""

from refgi.ledger.account import Ledger, Row, account, pixel_areas

__all__ = ["Ledger", "Row", "account", "pixel_areas"]
