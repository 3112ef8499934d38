"""Fast multipoles: what far particles do to each other, cell by cell (Greengard & Rokhlin 1987; Dehnen 2002, 2014).

Particles are sorted along Morton's curve and cut into a tree of cells. A cell acts on far ones through the moments of its
sources (`expansions`), and the field of far cells on the particles of a cell is one polynomial about its centre. A pair of
cells counts as far if the estimated error of that is small (`walk`).

indices, expansions   multi-indices; moments and polynomials, and how they are shifted
inverse_root          1/√x without a division
morton, sorting       keys, and their order
cells                 the tree, and the sums over the particles of its cells
direct                pairs of particles
walk                  pairs of cells, and whether their particles or their moments act field                 all of it, by
all threads together
"""
