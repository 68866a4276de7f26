"""Association in compiled loops: from segments and walls to pairs."""
