"""Formulas of scenarios: parser, operations, where they jump."""
