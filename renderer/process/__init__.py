"""The program around the renderer: memory, threads, signals, names of options."""
