"""How surfaces scatter light."""
