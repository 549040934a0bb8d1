"""The film of a render: sums of weighted samples, and the number of samples in each."""
