"""Methods of light transport, each a loop over the stages."""
