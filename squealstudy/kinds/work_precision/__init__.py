"""Work-precision studies: error of each method against its time, over one knob each."""
