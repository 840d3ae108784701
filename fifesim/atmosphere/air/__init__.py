"""What is in the air: profiles, molecules, aerosol and gases."""
