"""Which pixel lights there are (SII Sec. 3.5 to 3.7): taken from maps or light paths, warped, thinned in the open."""
