"""Cars that are built otherwise than their simulation says, drawn at random: structure beside a fault, or alone."""
