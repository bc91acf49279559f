"""Which effect causes the gap: the contest of the candidates, what speaks against its winner, the verdict."""
