"""From text to a tree of elements: XML, dictionaries, references, parameters."""
