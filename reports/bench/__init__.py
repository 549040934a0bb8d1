"""The laboratory bench: studies yield rows, one store keeps them, one runner measures."""
