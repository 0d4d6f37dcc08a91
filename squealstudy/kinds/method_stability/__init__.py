"""Method-stability studies: where a numerical method fails, predicted and measured."""
