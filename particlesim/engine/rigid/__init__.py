"""Rigid bodies: rotation, contact between bodies and with colliders, the kernel that steps them."""
