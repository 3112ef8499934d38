"""Hard contacts between particles: impulses at the end of a step, which keep those at rest where they are."""
