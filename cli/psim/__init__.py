"""The psim command: one file per subcommand."""
