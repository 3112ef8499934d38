"""From the text of a scenario to tables, and from mistakes to lines and columns."""
