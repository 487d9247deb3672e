"""The campus in three dimensions: ground, buildings, poles, trees, cars and walkers."""
