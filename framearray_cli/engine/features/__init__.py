"""Features of a job, each with its columns of hits: lights, glass, gloss, layers, and methods of indirect light."""
