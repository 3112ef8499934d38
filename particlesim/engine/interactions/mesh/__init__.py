"""Forces of all particles and all of their images in a periodic box, by a mesh (Ewald 1921; Hockney & Eastwood 1988).

1/r is cut into a near part, which neighbour lists sum pair by pair, and a smooth far part, which is summed over waves:
particles are spread over the nodes of a mesh, whose transform times an influence function is that of the potential, and
forces are its gradient where the particles are (Essmann et al. 1995).

split       the cut, and the law of the near part
influence   what a wave adds to the potential, and the error that a mesh makes
fourier     transforms of the mesh
splines     how a particle is spread over nodes
bricks      particles to the mesh and back
plan        cut, end of the near part and mesh for an accuracy
ewald       sums that are exact, to compare with
calibration the error that there is, and the plan that meets what was asked for
mesh_pairs  all of it, as an interaction of an island
"""
