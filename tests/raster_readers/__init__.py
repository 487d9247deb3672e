"""The ortho layer as GIS programs show it, beside a layer of points whose places are known."""
