"""Aerial images registered to an ortho layer by hand."""
