"""Ray and packet operations that all structures share."""
