"""Where each numerical method fails: predicted beside measured, on the smallest models."""
