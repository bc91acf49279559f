"""Which effect causes the gap: fits of the candidates, their goodness, the verdict."""
