"""Surfaces and strands that touch: cloth, hair, ropes and what lies on them (`contact` of model `impulse`)."""
