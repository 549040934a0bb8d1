"""The film of a render: its sums, who adds what to them, and how they become a picture."""
