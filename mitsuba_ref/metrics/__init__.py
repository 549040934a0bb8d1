"""How far one picture is from another, and where two right ones may differ."""
