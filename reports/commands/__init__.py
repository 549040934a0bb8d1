"""What the commands do: measure, write the records, draw the pages."""
