"""Advice without rendering: cautions about a scene, and possible simplifications."""
