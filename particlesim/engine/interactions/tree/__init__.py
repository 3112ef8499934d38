"""Fast multipoles: what far particles do to each other, cell by cell (Greengard & Rokhlin 1987; Dehnen 2002, 2014).

Particles are sorted along Morton's curve and cut into a tree of cells. A cell acts on far ones through the moments of its
sources (`expansions`), and what far cells do to the particles of a cell is one polynomial about its centre. Which
pairs of cells are far is decided by an estimate of the error that they make (`walk`).

indices, expansions   multi-indices; moments and polynomials, and how they are shifted
inverse_root          1/√x without a division
morton, sorting       keys, and their order
cells                 the tree, and the sums over the particles of its cells
direct                pairs of particles
walk                  which cells act how on which
field                 all of it, by all threads together
"""
