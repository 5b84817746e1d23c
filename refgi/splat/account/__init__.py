"""Where the power of the lights goes: the energy ledger of `sii`, from the light's side and from the screen's."""
