"""The exercises, one file for each chapter of the lecture."""
