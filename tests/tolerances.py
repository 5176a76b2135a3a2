"""Named tolerances, each with its reason."""

ROUNDING = 1e-13  # a few hundred operations of float64 on numbers of order one
AGREE = 1e-11  # what the project promises between engines, scaled
DIFFERENCE = 1e-6  # central differences with step 1e-5 of functions whose third derivatives are about 1e3
PRINTED = 5e-5  # half a unit of the fourth printed decimal
