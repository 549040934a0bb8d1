"""What a scene needs: what each simplification loses and saves, and the least model."""
