"""The film of a render: its sums, and how many samples each place of them holds."""
