"""What a run is held against: checks of quantities, with limits."""
