"""Pictures of the jobs against path-traced ones: how far the model is from the true light."""
