"""Contact of surfaces and strands: cloth, hair, ropes and particles on them (`contact` of model `impulse`)."""
