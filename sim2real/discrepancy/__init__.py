"""What a car's whole build makes of the residuals beside any effect (model discrepancy), and the decision with it."""
