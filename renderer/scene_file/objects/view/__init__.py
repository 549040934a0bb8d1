"""How the scene is looked at: sensor, film, sampler, integrator."""
