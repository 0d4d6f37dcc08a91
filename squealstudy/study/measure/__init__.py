"""What a method finds at chosen design points of a study, and what that costs."""
