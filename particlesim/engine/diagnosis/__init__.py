"""Why a run went wrong: the particle, the time, the force, and what to try."""
