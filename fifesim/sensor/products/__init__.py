"""Images as delivered by agencies: their metadata, and the scaling of their digital numbers."""
