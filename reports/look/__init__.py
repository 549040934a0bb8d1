"""The look of every page: its template, pictures, numbers in words."""
