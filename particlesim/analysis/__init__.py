"""What trajectories tell: series, plots, differences, stability."""
