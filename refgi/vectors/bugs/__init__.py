"""Likely bugs of each stage: what people who port it get wrong, and the literal forms that bugs are put into."""
