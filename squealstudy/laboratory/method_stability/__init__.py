"""Where each numerical method fails, predicted and measured, on the smallest models."""
