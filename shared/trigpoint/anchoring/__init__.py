"""How labels find their landmarks, and what one more label would tell: the rules of the solve, for all who ask."""
