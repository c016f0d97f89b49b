"""One hypothesis and its joint fit; many of them by successive halving."""
