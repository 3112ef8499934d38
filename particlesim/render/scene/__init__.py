"""What is drawn, and from where."""
