"""One step of one particle: methods, contacts, step sizes."""
