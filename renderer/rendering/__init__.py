"""One render: tiles over threads, summed on the film."""
