"""LAS and LAZ files to test with, whole and damaged."""
