"""What only commands and `pc_client.drawing` use: studies of movements, made with the rest of the client.

likeness     how human-like a movement is, in four figures
comparison   all generators of movements beside each other, planned and executed
extraction/  from recorded movements of a hand to Sigma-Lognormal strokes
drawing/     from a person's drawing to a movement of the arm, and what became of it
sweep/       many experiments from one file, resumable
executors    where many equal jobs run: processes of this machine or a Dask cluster
"""
