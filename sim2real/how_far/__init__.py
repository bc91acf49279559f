"""How large the gap is and how far it shrinks: in noise, as a rating, and in the error of TRPAC."""
