"""The records of long measurements in the repository, and how they changed over commits."""
