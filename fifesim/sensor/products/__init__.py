"""Images as agencies deliver them: what their metadata say, and how their digital numbers are scaled."""
