"""The atlas: where each method fails, how it was measured, and what to use instead."""
