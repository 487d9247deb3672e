"""Maps as QGIS itself reads and draws them; skipped where the distribution's python3-qgis is not installed."""
