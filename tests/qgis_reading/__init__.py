"""Maps as QGIS itself reads and draws them; tests of it are marked `qgis`."""
