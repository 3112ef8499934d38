"""Threads and signals of the process."""
