"""The map as files for other GIS programs: every format says its CRS, epoch, map version and uncertainty."""
