"""What compiled code is made of: how it is compiled, numbers in lanes, records."""
